// Training steps of the `nerf` field. The network's passes are the Mlp's; rays, sampling, occupancy and
// compositing are those of every field.
#include <fmt/format.h>

#include <cmath>

#include "nerf/steps/field_training.h"
#include "nerf/steps/mlp_shard.h"
#include "nerf/steps/train_options.h"

namespace nerf {
namespace {

constexpr int kShards = 4;
constexpr int kMinRays = 128;
constexpr int kWaveSamples = 4;  // few: a sample queried in vain costs a third of one that is trained on
// Light below 2e-2 is not followed. With intervals that shrink over the run, as those of `hash`, this was
// worth 0.8 dB on Lego after 105 CPU s.
constexpr float kEarlyStopDepth = 3.9f;
// The network forms its first shape within this many steps; dropping cells before would drop the scene. Then
// two random points of every cell decide, and later one of every 8th cell in turn.
constexpr std::uint64_t kWarmUpSteps = 192, kSweeps = 2, kProbeStride = 8;
constexpr std::uint64_t kRebuildEvery = 16;  // steps between rebuilds of the occupancy grid
static_assert(kWarmUpSteps % kRebuildEvery == 0);

class MlpTraining : public FieldTraining {
 public:
  MlpTraining(const Dataset& dataset,
              const TrainOptions& options,
              SceneField* scene_field,
              io::Workers* workers)
      : dataset_(dataset),
        options_(options),
        scene_field_(scene_field),
        field_(dynamic_cast<MlpField&>(*scene_field->field)),
        workers_(workers),
        shards_(kShards),
        candidates_(scene_field->grid.Candidates()),
        multiply_adds_(MultiplyAdds(MlpOptionsOf(field_.options()))) {}

  StepOutcome Step(double progress, TrainState* state) override;
  std::string Arithmetic() const override { return field_.network(0).Describe(); }
  double GemmGflops() const override { return field_.network(0).MeasureGemm(workers_->n_threads()); }

 private:
  bool IsPruned() const { return field_.quadrature().n_samples == 0; }
  // A multiply-add is 2 FLOP; backward costs twice the forward pass, and marching asks for density alone.
  double Flop(const MlpShard& shard) const {
    return 2 * multiply_adds_ *
           (static_cast<double>(shard.samples.visited_cell.size()) +
            3.0 * static_cast<double>(shard.n_differentiated));
  }
  std::string FaultOf(const std::vector<float>& gradients) const;
  void UpdateOccupancy(std::uint64_t done, std::uint64_t seed);

  const Dataset& dataset_;
  const TrainOptions& options_;
  SceneField* scene_field_;
  MlpField& field_;
  io::Workers* workers_;
  std::vector<MlpShard> shards_;
  std::vector<std::uint32_t> candidates_;
  double multiply_adds_;
};

StepOutcome MlpTraining::Step(double progress, TrainState* state) {
  BatchPlan plan{.seed = state->seed, .step = state->step, .n_shards = kShards, .wave_samples = kWaveSamples};
  plan.n_rays = IsPruned() ? std::min(state->n_rays, options_.mlp.rays) : options_.mlp.rays;
  const double share = std::min(1.0, progress / options_.mlp.step_scale_share);
  plan.step_scale = static_cast<float>(std::pow(options_.mlp.first_step_scale, 1.0 - share));
  scene_field_->step_scale = plan.step_scale;
  plan.early_stop_depth = kEarlyStopDepth;
  if (options_.mlp.white_background) plan.background = {1, 1, 1};
  const Sampler sampler(scene_field_->sampler_options, scene_field_->contraction, scene_field_->grid);
  const MlpShardContext context{dataset_, field_, sampler, plan};
  workers_->Run(kShards, [&](int shard, int) {
    RunMlpShard(context, shard, &shards_[static_cast<std::size_t>(shard)]);
  });

  StepOutcome outcome{.n_rays = static_cast<std::uint64_t>(plan.n_rays)};
  std::vector<float>& sum = shards_[0].gradients;
  for (MlpShard& shard : shards_) {
    outcome.n_samples += std::max<std::uint64_t>(shard.samples.visited_cell.size(), shard.n_differentiated);
    outcome.flop += Flop(shard);
    AddLoss(shard.loss, plan.n_rays, &outcome);
    if (shard.loss.bad_ray && outcome.fault.empty())
      outcome.fault = fmt::format("loss of ray {}", *shard.loss.bad_ray);
    if (&shard != &shards_[0]) {
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += shard.gradients[i];
    }
  }
  if (outcome.fault.empty()) outcome.fault = FaultOf(sum);
  if (!outcome.fault.empty()) return outcome;

  const double rate = options_.learning_rate > 0 ? options_.learning_rate : kMlpLearningRate;
  const double warm =
      std::min(1.0, static_cast<double>(state->step + 1) / std::max(1, options_.mlp.learning_rate_warm_up));
  field_.Step(rate * warm * state->learning_rate_scale * std::pow(options_.mlp.learning_rate_final, progress),
              state->step,
              sum.data());
  if (IsPruned()) {
    UpdateOccupancy(state->step + 1, state->seed);
    const int least = std::min(kMinRays, options_.mlp.rays);
    state->n_rays =
        NextRayCount(plan.n_rays, outcome.n_samples, options_.mlp.samples_per_step, least, options_.mlp.rays);
  }
  return outcome;
}

// The layer whose gradient is not finite, if any: 0 * x is 0 for every finite x and NaN otherwise.
std::string MlpTraining::FaultOf(const std::vector<float>& gradients) const {
  const std::vector<MlpLayer> layers = Layers(MlpOptionsOf(field_.options()));
  for (int network = 0; network < field_.n_networks(); ++network) {
    for (std::size_t l = 0; l < layers.size(); ++l) {
      const std::size_t at = static_cast<std::size_t>(network) * field_.weights_per_network();
      const std::size_t end = layers[l].biases + static_cast<std::size_t>(layers[l].outputs);
      float sum = 0;
      for (std::size_t i = at + layers[l].weights; i < at + end; ++i) sum += gradients[i] * 0.f;
      if (sum != 0.f) return fmt::format("gradient of layer {} ({})", l, layers[l].name);
    }
  }
  return "";
}

void MlpTraining::UpdateOccupancy(std::uint64_t done, std::uint64_t seed) {
  for (const MlpShard& shard : shards_) VisitCells(shard.samples, &scene_field_->grid);
  if (done < kWarmUpSteps || done % kRebuildEvery != 0) return;
  if (done == kWarmUpSteps) {
    // From here on only what the network itself has found counts, not the first guess.
    scene_field_->grid.Forget();
    for (std::uint64_t sweep = 0; sweep < kSweeps; ++sweep)
      ProbeOccupancy(candidates_, 1, 0, seed + sweep, done, scene_field_, workers_);
  }
  ProbeOccupancy(candidates_, kProbeStride, done / kRebuildEvery, seed, done, scene_field_, workers_);
  scene_field_->grid.Rebuild(true);
}

}  // namespace

std::unique_ptr<FieldTraining> MakeMlpTraining(const Dataset& dataset,
                                               const TrainOptions& options,
                                               SceneField* scene_field,
                                               io::Workers* workers,
                                               const CaptureTerms&) {
  return std::make_unique<MlpTraining>(dataset, options, scene_field, workers);
}

TrainOptions ReportTrainOptions() {
  TrainOptions options;
  options.steps = 100000;
  options.learning_rate = 5e-4;
  options.field.kind = FieldKind::kMlp;
  options.field.mlp = {.position = {.frequencies = 10, .identity = true, .times_pi = false},
                       .direction = {.frequencies = 4, .identity = true, .times_pi = false},
                       .scene_units = true,
                       .density = DensityActivation::kRelu,
                       .initialisation = Initialisation::kUniform,
                       .pixel_centres = false,
                       .quadrature = {.n_samples = 192, .open_end = true},
                       .bf16 = PrefersBf16("cpu")};
  options.mlp = {
      .rays = 4096, .learning_rate_final = 1, .learning_rate_warm_up = 0, .white_background = true};
  return options;
}

}  // namespace nerf
