#include "nerf/trainer.h"

#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include "io/check.h"
#include "io/interrupt.h"
#include "io/progress.h"
#include "nerf/checkpoint.h"
#include "nerf/monitor.h"
#include "nerf/random.h"
#include "nerf/train_shard.h"

namespace nerf {
namespace {

using Clock = std::chrono::steady_clock;

// Training follows a ray to a transmittance of 1e-3; in unbounded scenes, where thin leftovers behind the
// surfaces would take most of the samples, to 2e-2. The loss closes what is left.
constexpr float kEarlyStopDepth = 6.9f, kUnboundedEarlyStopDepth = 3.9f;
constexpr int kMinRays = 256, kMaxRays = 1 << 17;
constexpr int kRebuildEvery = 16;  // steps between rebuilds of the occupancy grid
// At each rebuild every 16th candidate cell is probed, in turn; while the first coarse shape forms, every one
// is.
constexpr std::uint64_t kProbeStride = 16, kSweepSteps = 256;
constexpr double kLossDecay = 0.98;           // running mean of the squared error, about 50 steps
constexpr std::uint64_t kCollapseStep = 500;  // by then a living field is far above a constant picture
constexpr double kCollapseMarginDb = 0.1, kCollapseOpacity = 1e-3;
constexpr int kMaxSkippedSteps = 3;
constexpr double kMonitorGrowth = 1.5;  // monitoring moments grow geometrically ...
constexpr double kFirstMonitorS = 1.0;  // ... from one second of training on

double Seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

double CpuSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

class Trainer {
 public:
  Trainer(const io::Scene& scene,
          const io::Scene& heldout,
          const TrainOptions& options,
          const std::filesystem::path& folder)
      : scene_(scene),
        options_(options),
        folder_(folder),
        workers_(options.threads),
        dataset_(LoadDataset(scene, options.threads)),
        monitor_(heldout, options.threads),
        curve_(folder / "curve.csv"),
        shards_(kShards),
        scratch_(static_cast<std::size_t>(options.threads)) {}

  TrainReport Run();

 private:
  void Begin();
  double Progress(double elapsed_s) const;
  void Step(double progress);
  void Merge(double progress);
  void UpdateOccupancy();
  bool HasCollapsed() const;
  void Restart();
  void Monitor(double elapsed_s);
  void Save(double elapsed_s);

  const io::Scene& scene_;
  const TrainOptions options_;
  const std::filesystem::path folder_;
  Workers workers_;
  const Dataset dataset_;
  HeldoutMonitor monitor_;
  std::unique_ptr<SceneField> scene_field_;
  TrainState state_;
  TrainingCurve curve_;
  std::vector<ShardResult> shards_;
  std::vector<ShardScratch> scratch_;
  TrainReport report_;
  double loss_ = 0, opacity_ = 0;
  double constant_squared_error_ = 0;
  std::vector<std::uint32_t> candidates_;  // cells that may hold something
  std::uint64_t n_samples_ = 0, n_rays_ = 0;
};

void Trainer::Begin() {
  const std::filesystem::path checkpoint = folder_ / "checkpoint.bin";
  if (std::filesystem::exists(checkpoint)) {
    scene_field_ = ReadCheckpoint(checkpoint, &state_);
    report_.events.push_back("resumed at step " + std::to_string(state_.step));
  } else {
    state_.seed = options_.seed;
    state_.channels = dataset_.channels;
    scene_field_ =
        MakeSceneField(scene_, dataset_, options_.field, state_.seed, &workers_, &report_.derivation);
  }
  constant_squared_error_ = ConstantSquaredError(dataset_);
  candidates_ = scene_field_->grid.Candidates();
}

double Trainer::Progress(double elapsed_s) const {
  const double progress =
      options_.steps > 0 ? static_cast<double>(state_.step) / options_.steps : elapsed_s / options_.time_s;
  return std::min(progress, 1.0);
}

void Trainer::Step(double progress) {
  BatchPlan plan{.seed = state_.seed, .step = state_.step, .n_rays = state_.n_rays};
  const double share = std::min(1.0, progress / options_.step_scale_share);
  plan.step_scale = static_cast<float>(std::pow(options_.first_step_scale, 1.0 - share));
  plan.early_stop_depth = scene_field_->map.unbounded ? kUnboundedEarlyStopDepth : kEarlyStopDepth;
  const Sampler sampler(scene_field_->sampler_options, scene_field_->map, scene_field_->grid);
  workers_.Run(kShards, [&](int shard, int thread) {
    TrainShard(dataset_,
               scene_field_->field,
               sampler,
               plan,
               shard,
               &scratch_[static_cast<std::size_t>(thread)],
               &shards_[static_cast<std::size_t>(shard)]);
  });

  std::uint64_t marched = 0;
  double squared_error = 0;
  loss_ = opacity_ = 0;
  for (const ShardResult& shard : shards_) {
    marched += shard.visited_cell.size();
    loss_ += shard.loss / plan.n_rays;
    opacity_ += shard.opacity / plan.n_rays;
    squared_error += shard.squared_error / (3.0 * plan.n_rays);
    if (!shard.finite) {
      const std::string where = "step " + std::to_string(state_.step) + ", ray " +
                                std::to_string(shard.first_bad_ray) + ", seed " + std::to_string(state_.seed);
      if (++state_.skipped_steps > kMaxSkippedSteps) {
        throw io::Error(io::ExitCode::kNumeric,
                        "non-finite loss or gradient at " + where,
                        "Lower --learning-rate or change --seed");
      }
      report_.events.push_back("skipped a non-finite batch at " + where + "; learning rate halved");
      state_.learning_rate_scale *= 0.5;
      ++state_.step;
      return;
    }
  }
  n_samples_ += marched;
  n_rays_ += static_cast<std::uint64_t>(plan.n_rays);
  state_.squared_error = state_.squared_error < 0
                             ? squared_error
                             : kLossDecay * state_.squared_error + (1 - kLossDecay) * squared_error;
  Merge(progress);
  ++state_.step;
  if (state_.step % kRebuildEvery == 0) UpdateOccupancy();
  // The next batch aims at the same number of samples; at most a factor 2 per step, since one batch may be
  // unusual.
  const double wanted = static_cast<double>(plan.n_rays) * options_.samples_per_step /
                        static_cast<double>(std::max<std::uint64_t>(marched, 1));
  const double bounded = std::clamp(wanted, 0.5 * plan.n_rays, 2.0 * plan.n_rays);
  state_.n_rays = static_cast<int>(std::clamp(bounded, double{kMinRays}, double{kMaxRays}));
}

// Gradients of all shards, in shard order, into the field: one task per grid level and one for networks and
// occupancy.
void Trainer::Merge(double progress) {
  HashField& field = scene_field_->field;
  const double tail =
      std::max(0.0, progress - options_.learning_rate_hold) / (1.0 - options_.learning_rate_hold);
  const auto t = static_cast<double>(state_.step + 1);
  kernels::AdamStep step;
  step.learning_rate = static_cast<float>(options_.learning_rate * state_.learning_rate_scale *
                                          std::pow(options_.learning_rate_final, tail));
  step.correction1 = static_cast<float>(1.0 / (1.0 - std::pow(double{step.beta1}, t)));
  step.correction2 = static_cast<float>(1.0 / (1.0 - std::pow(double{step.beta2}, t)));
  const int n_levels = static_cast<int>(field.levels().size());
  workers_.Run(n_levels + 1, [&](int task, int) {
    if (task < n_levels) {
      const int level = n_levels - 1 - task;  // the finest, slowest levels first
      for (const ShardResult& shard : shards_) {
        const float* gradients =
            shard.feature_gradients.data() + static_cast<std::size_t>(level) * shard.feature_gradient_stride;
        field.Scatter(level, gradients, shard.samples, shard.samples.size());
      }
      field.StepTable(level, step);
      return;
    }
    std::vector<float>& sum = shards_[0].weight_gradients;
    for (std::size_t s = 1; s < shards_.size(); ++s) {
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += shards_[s].weight_gradients[i];
    }
    field.StepWeights(step, sum.data());
    for (const ShardResult& shard : shards_) {
      for (std::size_t i = 0; i < shard.visited_cell.size(); ++i)
        scene_field_->grid.Visit(shard.visited_cell[i], shard.visited_sigma[i]);
    }
  });
}

void Trainer::UpdateOccupancy() {
  OccupancyGrid& grid = scene_field_->grid;
  const std::uint64_t rebuild = state_.step / kRebuildEvery;
  const std::uint64_t stride = state_.step <= kSweepSteps ? 1 : kProbeStride;
  std::vector<std::uint32_t> cells;
  for (std::size_t i = rebuild % stride; i < candidates_.size(); i += stride) cells.push_back(candidates_[i]);
  std::vector<float> sigma(cells.size());
  constexpr std::size_t kTask = 4096;
  const float size = 1.f / static_cast<float>(grid.resolution());
  workers_.Run(static_cast<int>((cells.size() + kTask - 1) / kTask), [&](int task, int thread) {
    const std::size_t first = static_cast<std::size_t>(task) * kTask,
                      last = std::min(cells.size(), first + kTask);
    ShardScratch& scratch = scratch_[static_cast<std::size_t>(thread)];
    scratch.wave.clear();
    for (std::size_t i = first; i < last; ++i) {
      Random random(state_.seed, Stream::kProbe, state_.step, 3 * i);
      const std::array<float, 3> centre = grid.CellCentre(cells[i]);
      scratch.wave.x.push_back(centre[0] + size * (random.Uniform() - 0.5f));
      scratch.wave.y.push_back(centre[1] + size * (random.Uniform() - 0.5f));
      scratch.wave.z.push_back(centre[2] + size * (random.Uniform() - 0.5f));
    }
    scratch.rows.Resize(static_cast<int>(last - first));
    scene_field_->field.Encode(scratch.wave, 0, scratch.rows.n, scratch.rows.features.data());
    scene_field_->field.QueryDensity(scratch.rows.features.data(), &scratch.rows);
    std::copy_n(scratch.rows.sigma.begin(), last - first, sigma.begin() + static_cast<std::ptrdiff_t>(first));
  });
  for (std::size_t i = 0; i < cells.size(); ++i) grid.Probe(cells[i], sigma[i]);
  grid.Rebuild();
}

bool Trainer::HasCollapsed() const {
  const double gain_db = 10 * std::log10(constant_squared_error_ / state_.squared_error);
  return opacity_ < kCollapseOpacity || gain_db < kCollapseMarginDb;
}

void Trainer::Restart() {
  report_.events.push_back("collapsed by step " + std::to_string(state_.step) + " with seed " +
                           std::to_string(state_.seed) + "; restarted with the next seed");
  TrainState fresh;
  fresh.seed = state_.seed + 1;
  fresh.restarts = state_.restarts + 1;
  fresh.channels = state_.channels;
  state_ = fresh;
  scene_field_ =
      MakeSceneField(scene_, dataset_, options_.field, state_.seed, &workers_, &report_.derivation);
  candidates_ = scene_field_->grid.Candidates();
}

void Trainer::Monitor(double elapsed_s) {
  CurvePoint point{.step = state_.step, .wall_s = elapsed_s, .cpu_s = CpuSeconds(), .loss = loss_};
  point.train_psnr = -10 * std::log10(std::max(state_.squared_error, 1e-12));
  point.heldout_psnr = monitor_.Psnr(*scene_field_, &workers_);
  report_.curve.push_back(point);
  curve_.Add(point);
  report_.heldout_psnr = point.heldout_psnr;
}

void Trainer::Save(double elapsed_s) {
  state_.elapsed_s = elapsed_s;
  WriteCheckpoint(folder_ / "checkpoint.bin", scene_field_.get(), state_);
  curve_.Write();
}

TrainReport Trainer::Run() {
  const Clock::time_point start = Clock::now();
  Begin();
  // Monitoring and checkpoints do not count as training time; making the field does.
  const double resumed_s = state_.elapsed_s;
  double excluded_s = 0;
  const auto elapsed = [&] { return resumed_s + Seconds(Clock::now() - start) - excluded_s; };
  const auto excluding = [&](auto&& work) {
    const Clock::time_point begin = Clock::now();
    work();
    excluded_s += Seconds(Clock::now() - begin);
  };
  io::Progress bar("train");
  double next_monitor_s = std::max(kFirstMonitorS, resumed_s * kMonitorGrowth);
  double next_save_s = elapsed() + options_.checkpoint_every_s;
  double last_rate_s = elapsed();
  std::uint64_t last_rate_rays = 0;
  double rays_per_s = 0;
  for (double now = elapsed(); Progress(now) < 1.0; now = elapsed()) {
    Step(Progress(now));
    if (state_.step == kCollapseStep && state_.restarts == 0 && HasCollapsed()) Restart();
    if (io::PendingInterrupt()) {
      Save(elapsed());
      io::ThrowIfInterrupted();
    }
    now = elapsed();
    if (now >= next_monitor_s) {
      excluding([&] { Monitor(now); });
      next_monitor_s = std::max(now * kMonitorGrowth, next_monitor_s);
    }
    if (now >= next_save_s) {
      excluding([&] { Save(now); });
      next_save_s = now + options_.checkpoint_every_s;
    }
    if (now - last_rate_s > 0.5) {
      rays_per_s = static_cast<double>(n_rays_ - last_rate_rays) / (now - last_rate_s);
      last_rate_s = now;
      last_rate_rays = n_rays_;
      char note[120];
      const double train_db = -10 * std::log10(std::max(state_.squared_error, 1e-12));
      std::snprintf(note,
                    sizeof note,
                    "train %.2f dB  held-out %.2f dB  %.0f k rays/s",
                    train_db,
                    report_.heldout_psnr,
                    rays_per_s / 1e3);
      bar.Update(Progress(now), note);
    }
  }
  report_.train_s = elapsed();
  scene_field_->grid.Rebuild();
  Monitor(report_.train_s);
  Save(report_.train_s);
  const double this_run_s = std::max(report_.train_s - resumed_s, 1e-9);
  report_.steps = state_.step;
  report_.parameters = scene_field_->field.n_parameters();
  report_.samples_per_s = static_cast<double>(n_samples_) / this_run_s;
  report_.rays_per_s = static_cast<double>(n_rays_) / this_run_s;
  report_.samples_per_ray =
      static_cast<double>(n_samples_) / static_cast<double>(std::max<std::uint64_t>(n_rays_, 1));
  report_.occupied_share = scene_field_->grid.OccupiedShare();
  report_.skipped_steps = state_.skipped_steps;
  report_.restarts = state_.restarts;
  report_.kernels = kernels::ActiveKernels().name;
  return report_;
}

}  // namespace

TrainReport Train(const io::Scene& scene,
                  const io::Scene& heldout,
                  const TrainOptions& options,
                  const std::filesystem::path& folder) {
  PIPELINE_CHECK_GT(options.threads, 0);
  return Trainer(scene, heldout, options, folder).Run();
}

}  // namespace nerf
