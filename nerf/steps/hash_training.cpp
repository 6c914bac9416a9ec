// Training steps of the `hash` field: Adam on tables and networks, own kernels throughout.
#include <fmt/format.h>

#include <cmath>
#include <variant>

#include "io/process/ranks.h"
#include "nerf/fields/hash_field.h"
#include "nerf/steps/field_training.h"
#include "nerf/steps/hash_shard.h"
#include "nerf/steps/shard_exchange.h"
#include "nerf/steps/train_options.h"

namespace nerf {
namespace {

constexpr int kShards = 16;
// Training follows a ray to a transmittance of 1e-2; in unbounded scenes, where thin leftovers behind the
// surfaces would take most of the samples, to 2e-2. The loss closes what is left.
constexpr float kEarlyStopDepth = 4.6f, kUnboundedEarlyStopDepth = 3.9f;
// Weight of the distortion loss in unbounded scenes: the few views that see a far place would be satisfied by
// fog as well. The weight grows over the first share of a run: at full weight from the start it can drive all
// light into fog right before the cameras.
constexpr double kUnboundedDistortion = 0.005, kDistortionShare = 0.15;
// Of the depths of sparse points, in unbounded scenes. They form the surface early, which saves samples.
constexpr float kDepthShare = 0.1f, kDepthWeight = 0.1f;
// Of light near the cameras, in unbounded scenes: a surface that moves away by a tenth of the reach gains as
// much as a squared error of 45 dB costs, so that little more than ties is decided. At first, while the light
// comes from fog, it weighs so many times more, falling over the first share of a run: a wall that has
// become opaque hardly moves.
constexpr double kNearnessWeight = 3e-4, kFirstNearness = 11, kNearnessShare = 0.25;
// Of what stands before the sky, in unbounded scenes: as much as a squared error of 15 dB, which clouds that
// moved between the pictures have, so that they do not become lumps before each camera.
constexpr float kSkyWeight = 0.03f;
// Share of a run of an unbounded scene after which space that was found empty stays so: what comes late into
// the open is seldom a surface, and often the noise of one picture, painted on a wall before its camera.
constexpr double kSettledShare = 0.15;
constexpr int kMinRays = 256, kMaxRays = 1 << 17;
// Samples between rebuilds of the occupancy grid.
constexpr std::uint64_t kRebuildSamples = 1 << 20;
// At each rebuild every 16th candidate cell is probed, in turn; while the first coarse shape forms, every 4th
// is.
constexpr std::uint64_t kProbeStride = 16, kFirstProbeStride = 4, kFirstSamples = 1 << 24;
// Few, so that rays end soon after they became opaque; the time that this saves is spent on more rays.
constexpr int kWaveSamples = 4;

// Of cameras, in pixels per step, at first. It falls as that of the field does.
constexpr double kCameraLearningRate = 0.03;

template <typename Real>
class HashTraining : public FieldTraining {
 public:
  HashTraining(const Dataset& dataset,
               const TrainOptions& options,
               SceneField* scene_field,
               HashField* field,
               HashNetwork<Real>* network,
               const CaptureTerms& terms,
               io::Workers* workers)
      : dataset_(dataset),
        options_(options),
        schedule_(ScheduleOf(options, dataset.channels == 4)),
        rebuild_every_(std::max<std::uint64_t>(
            1, kRebuildSamples / static_cast<std::uint64_t>(options.samples_per_step))),
        full_gradient_distance_(FullGradientDistance(dataset)),
        scene_field_(scene_field),
        grid_(field->grid()),
        network_(*network),
        trained_cells_(field->trained_cells()),
        terms_(terms),
        workers_(workers),
        shards_(kShards),
        scratch_(static_cast<std::size_t>(workers->n_threads())),
        table_gradients_(scratch_.size(), AlignedVector<float>(grid_.gradient_size(), 0.f)),
        candidates_(scene_field->grid.Candidates()) {}

  StepOutcome Step(double progress, TrainState* state) override;
  std::string Arithmetic() const override {
    return fmt::format("{} kernels, {}", kernels::ActiveKernels().name, sizeof(Real) == 2 ? "bf16" : "fp32");
  }

 private:
  BatchPlan Plan(double progress, const TrainState& state) const;
  void RunShards(const BatchPlan& plan);
  void Merge(double progress, const TrainState& state);
  void RefineCameras(double progress, const TrainState& state);
  void UpdateOccupancy(double progress, std::uint64_t done, std::uint64_t seed);

  const Dataset& dataset_;
  const TrainOptions& options_;
  const TrainingSchedule schedule_;
  const std::uint64_t rebuild_every_;  // steps
  const float full_gradient_distance_;
  SceneField* scene_field_;
  HashGrid& grid_;
  HashNetwork<Real>& network_;
  TrainedCells& trained_cells_;
  const CaptureTerms terms_;
  io::Workers* workers_;
  std::vector<HashShard<Real>> shards_;
  std::vector<HashShardScratch<Real>> scratch_;
  std::vector<AlignedVector<float>> table_gradients_;  // of one level, by thread; zero between uses
  std::vector<std::uint32_t> candidates_;              // cells that may hold something
};

template <typename Real>
BatchPlan HashTraining<Real>::Plan(double progress, const TrainState& state) const {
  BatchPlan plan{.seed = state.seed, .step = state.step, .n_shards = kShards};
  plan.samples_per_pixel = schedule_.SamplesPerPixel(progress);
  plan.n_rays = std::max(1, state.n_rays / plan.samples_per_pixel) * plan.samples_per_pixel;
  plan.step_scale = static_cast<float>(schedule_.StepScale(progress));
  plan.wave_samples = kWaveSamples;
  plan.early_stop_depth = scene_field_->contraction.unbounded ? kUnboundedEarlyStopDepth : kEarlyStopDepth;
  if (scene_field_->contraction.unbounded) {
    plan.distortion = static_cast<float>(kUnboundedDistortion * std::min(1.0, progress / kDistortionShare));
    plan.full_gradient_distance = full_gradient_distance_;
    plan.depth_share = kDepthShare, plan.depth_weight = kDepthWeight;
    const double first = std::max(0.0, 1 - progress / kNearnessShare);
    plan.near_cameras = terms_.near_cameras;
    plan.sky_weight = kSkyWeight;
    plan.nearness_weight = static_cast<float>(kNearnessWeight * (1 + (kFirstNearness - 1) * first));
  }
  plan.ends_at_infinity = scene_field_->EndsAtInfinity();
  plan.min_weight = static_cast<float>(options_.min_weight);
  return plan;
}

template <typename Real>
void HashTraining<Real>::RunShards(const BatchPlan& plan) {
  const Sampler sampler(scene_field_->sampler_options, scene_field_->contraction, scene_field_->grid);
  const HashShardContext<Real> context{dataset_, grid_, network_, sampler, plan, terms_.refinement};
  const io::Ranks& ranks = io::AllRanks();
  const int first = io::FirstTask(kShards, ranks.rank(), ranks.size()),
            last = io::FirstTask(kShards, ranks.rank() + 1, ranks.size());
  workers_->Run(last - first, [&](int i, int thread) {
    RunHashShard(context,
                 first + i,
                 &scratch_[static_cast<std::size_t>(thread)],
                 &shards_[static_cast<std::size_t>(first + i)]);
  });
  if (ranks.AreSeveral()) ExchangeShards(network_, plan.step, grid_.levels().size(), &shards_);
}

template <typename Real>
StepOutcome HashTraining<Real>::Step(double progress, TrainState* state) {
  const BatchPlan plan = Plan(progress, *state);
  scene_field_->samples_per_pixel = plan.samples_per_pixel;
  scene_field_->step_scale = plan.step_scale;
  RunShards(plan);
  const double n_pixels = static_cast<double>(plan.n_rays) / plan.samples_per_pixel;
  StepOutcome outcome{.n_rays = static_cast<std::uint64_t>(plan.n_rays)};
  for (const HashShard<Real>& shard : shards_) {
    outcome.n_samples += shard.samples.visited_cell.size();
    AddLoss(shard.loss, n_pixels, &outcome);
    if (shard.loss.bad_ray) {
      outcome.fault = fmt::format("loss or gradient of ray {}", *shard.loss.bad_ray);
      return outcome;
    }
  }
  Merge(progress, *state);
  if (terms_.refinement) RefineCameras(progress, *state);
  UpdateOccupancy(progress, state->step + 1, state->seed);
  state->n_rays = NextRayCount(plan.n_rays, outcome.n_samples, options_.samples_per_step, kMinRays, kMaxRays);
  return outcome;
}

template <typename Real>
void HashTraining<Real>::RefineCameras(double progress, const TrainState& state) {
  std::vector<Vector6d> sum(dataset_.views.size(), Vector6d::Zero());
  for (const HashShard<Real>& shard : shards_) {
    for (std::size_t v = 0; v < shard.camera_gradients.size(); ++v) sum[v] += shard.camera_gradients[v];
  }
  const double decay = schedule_.LearningRate(progress) / schedule_.learning_rate;
  terms_.refinement->Step(state.step + 1, kCameraLearningRate * decay, sum);
}

// After `done` steps.
template <typename Real>
void HashTraining<Real>::UpdateOccupancy(double progress, std::uint64_t done, std::uint64_t seed) {
  if (done % rebuild_every_ != 0) return;
  const std::uint64_t n_samples = done * static_cast<std::uint64_t>(options_.samples_per_step);
  const std::uint64_t stride = n_samples <= kFirstSamples ? kFirstProbeStride : kProbeStride;
  trained_cells_.Refresh();
  ProbeOccupancy(candidates_, stride, done / rebuild_every_, seed, done, scene_field_, workers_);
  scene_field_->grid.Rebuild();
  if (scene_field_->contraction.unbounded && progress >= kSettledShare) {
    scene_field_->grid.Settle();
    candidates_ = scene_field_->grid.Candidates();
  }
}

// Gradients of all shards, in shard order, into the field: one task per grid level and one for networks and
// occupancy.
template <typename Real>
void HashTraining<Real>::Merge(double progress, const TrainState& state) {
  const auto t = static_cast<double>(state.step + 1);
  kernels::AdamStep step;
  step.learning_rate = static_cast<float>(schedule_.LearningRate(progress) * state.learning_rate_scale);
  step.correction1 = static_cast<float>(1.0 / (1.0 - std::pow(double{step.beta1}, t)));
  step.correction2 = static_cast<float>(1.0 / (1.0 - std::pow(double{step.beta2}, t)));
  const int n_levels = static_cast<int>(grid_.levels().size());
  workers_->Run(n_levels + 1, [&](int task, int thread) {
    if (task < n_levels) {
      float* table_gradients = table_gradients_[static_cast<std::size_t>(thread)].data();
      const int level = n_levels - 1 - task;  // the finest, slowest levels first
      for (const HashShard<Real>& shard : shards_) {
        const Real* gradients =
            shard.feature_gradients.data() + static_cast<std::size_t>(level) * shard.feature_gradient_stride;
        const Samples& samples = shard.samples.sorted;
        grid_.Scatter(level, gradients, samples, samples.size(), table_gradients);
      }
      grid_.Step(level, step, table_gradients);
      return;
    }
    std::vector<float>& sum = shards_[0].weight_gradients;
    for (std::size_t s = 1; s < shards_.size(); ++s) {
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += shards_[s].weight_gradients[i];
    }
    network_.Step(step, sum.data());
    for (const HashShard<Real>& shard : shards_) VisitCells(shard.samples, &scene_field_->grid);
    if (scene_field_->contraction.unbounded) {
      for (const HashShard<Real>& shard : shards_) trained_cells_.Mark(shard.samples.sorted, progress);
    }
  });
}

}  // namespace

std::unique_ptr<FieldTraining> MakeHashTraining(const Dataset& dataset,
                                                const TrainOptions& options,
                                                SceneField* scene_field,
                                                io::Workers* workers,
                                                const CaptureTerms& terms) {
  HashField& field = dynamic_cast<HashField&>(*scene_field->field);
  const auto make = [&]<typename Real>(HashNetwork<Real>& network) -> std::unique_ptr<FieldTraining> {
    return std::make_unique<HashTraining<Real>>(
        dataset, options, scene_field, &field, &network, terms, workers);
  };
  return std::visit(make, field.network());
}

}  // namespace nerf
