#include "nerf/training/trainer.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>

#include "io/base/check.h"
#include "io/base/interrupt.h"
#include "io/base/progress.h"
#include "io/base/resource_meter.h"
#include "nerf/data/hull_pixels.h"
#include "nerf/data/plain_background.h"
#include "nerf/training/field_training.h"
#include "nerf/training/heldout_monitor.h"

namespace nerf {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kLossDecay = 0.98;           // running mean of the squared error, about 50 steps
constexpr std::uint64_t kCollapseStep = 500;  // by then a living field is far above a constant picture
constexpr double kCollapseMarginDb = 0.1, kCollapseOpacity = 1e-3;
constexpr int kMaxSkippedSteps = 3;
constexpr double kMonitorGrowth = 1.5;        // monitoring moments grow geometrically ...
constexpr double kTargetMonitorGrowth = 1.1;  // (where they decide when to stop)
constexpr double kFirstMonitorS = 1.0;        // ... from one second of training on
constexpr double kMonitorShare = 0.2;         // and take at most this share of the training time

double Seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

class Trainer {
 public:
  Trainer(const io::Scene& scene,
          const io::Scene& heldout,
          const TrainOptions& options,
          const std::filesystem::path& folder)
      : scene_(scene),
        heldout_(heldout),
        options_(options),
        folder_(folder),
        workers_(options.threads),
        dataset_(LoadDataset(scene, options.threads, PixelOffset())),
        curve_(folder / "curve.csv") {}

  TrainReport Run();

 private:
  double PixelOffset() const;
  void Begin();
  void MakeField();
  void MakeTraining();
  double Progress(double elapsed_s) const;
  void Step(double progress);
  bool HasCollapsed() const;
  void Restart();
  void Monitor(double elapsed_s);
  void Save(double elapsed_s);

  // Training time counts from here on, the reading of the pictures included.
  const Clock::time_point start_ = Clock::now();
  const io::Scene &scene_, &heldout_;
  TrainOptions options_;
  const std::filesystem::path folder_;
  io::Workers workers_;
  Dataset dataset_;
  std::optional<HeldoutMonitor> monitor_;
  std::unique_ptr<SceneField> scene_field_;
  TrainState state_;
  TrainingCurve curve_;
  std::unique_ptr<FieldTraining> training_;
  TrainReport report_;
  double loss_ = 0, opacity_ = 0;
  double constant_squared_error_ = 0;
  std::uint64_t n_samples_ = 0, n_rays_ = 0;
  double flop_ = 0, excluded_cpu_s_ = 0;  // monitoring and checkpoints do not count
};

double Trainer::PixelOffset() const {
  const bool corners = options_.field.field == "nerf" && !options_.field.nerf.pixel_centres;
  return corners ? 0.0 : 0.5;
}

void Trainer::MakeTraining() {
  if (options_.field.field == "hash" && dataset_.channels == 4) {
    DropPixelsBesideHull(scene_, scene_field_->map, scene_field_->grid.resolution(), &workers_, &dataset_);
  }
  const auto make = options_.field.field == "nerf" ? MakeNerfTraining : MakeHashTraining;
  training_ = make(dataset_, options_, scene_field_.get(), &workers_);
}

void Trainer::MakeField() {
  const TrainingSchedule schedule = ScheduleOf(options_, dataset_.channels == 4);
  SceneFieldOptions field = options_.field;
  field.log2_hashmap_size = schedule.log2_hashmap_size;
  field.finest_cell_pixels = schedule.finest_cell_pixels;
  field.entry_moments = schedule.entry_moments;
  scene_field_ = MakeSceneField(scene_, dataset_, field, state_.seed, &workers_, &report_.derivation);
  if (field.field == "hash") report_.events.push_back("schedule for this budget: " + schedule.Text());
  MakeTraining();
}

void Trainer::Begin() {
  MarkPlainBackground(&dataset_);
  const std::filesystem::path checkpoint = folder_ / "checkpoint.bin";
  if (std::filesystem::exists(checkpoint)) {
    scene_field_ = ReadCheckpoint(checkpoint, &state_);
    if (options_.target_psnr > 0) options_.time_s = state_.budget_s;
    report_.events.push_back("resumed at step " + std::to_string(state_.step));
    MakeTraining();
  } else {
    state_.seed = options_.seed;
    state_.budget_s = options_.time_s;
    state_.channels = dataset_.channels;
    MakeField();
  }
  const bool white = options_.field.field == "nerf" && options_.nerf.white_background;
  constant_squared_error_ = ConstantSquaredError(dataset_, white ? 1.0 : 0.5);
}

double Trainer::Progress(double elapsed_s) const {
  const double progress =
      options_.steps > 0 ? static_cast<double>(state_.step) / options_.steps : elapsed_s / options_.time_s;
  return std::min(progress, 1.0);
}

void Trainer::Step(double progress) {
  const StepOutcome outcome = training_->Step(progress, &state_);
  loss_ = outcome.loss;
  opacity_ = outcome.opacity;
  if (!outcome.fault.empty()) {
    const std::string where =
        outcome.fault + ", step " + std::to_string(state_.step) + ", seed " + std::to_string(state_.seed);
    if (++state_.skipped_steps > kMaxSkippedSteps) {
      throw io::Error(
          io::ExitCode::kNumeric, "not finite: " + where, "Lower --learning-rate or change --seed");
    }
    report_.events.push_back("skipped a step that was not finite: " + where + "; learning rate halved");
    state_.learning_rate_scale *= 0.5;
  } else {
    n_samples_ += outcome.n_samples;
    n_rays_ += outcome.n_rays;
    flop_ += outcome.flop;
    state_.squared_error = state_.squared_error < 0
                               ? outcome.squared_error
                               : kLossDecay * state_.squared_error + (1 - kLossDecay) * outcome.squared_error;
  }
  ++state_.step;
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
  fresh.budget_s = state_.budget_s;
  state_ = fresh;
  MakeField();
}

void Trainer::Monitor(double elapsed_s) {
  CurvePoint point{.step = state_.step,
                   .wall_s = elapsed_s,
                   .cpu_s = io::ProcessCpuSeconds() - excluded_cpu_s_,
                   .loss = loss_};
  point.train_psnr = -10 * std::log10(std::max(state_.squared_error, 1e-12));
  point.heldout_psnr = monitor_->Psnr(*scene_field_, &workers_);
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
  Begin();
  // Monitoring and checkpoints do not count as training time; reading pictures and making the field do.
  const double resumed_s = state_.elapsed_s;
  double excluded_s = 0;
  const auto elapsed = [&] { return resumed_s + Seconds(Clock::now() - start_) - excluded_s; };
  const auto excluding = [&](auto&& work) {
    const Clock::time_point begin = Clock::now();
    const double cpu_begin = io::ProcessCpuSeconds();
    work();
    excluded_s += Seconds(Clock::now() - begin);
    excluded_cpu_s_ += io::ProcessCpuSeconds() - cpu_begin;
  };
  excluding([&] { monitor_.emplace(heldout_, options_.threads, PixelOffset()); });
  io::Progress bar("train");
  double next_monitor_s = std::max(kFirstMonitorS, resumed_s * kMonitorGrowth);
  double next_save_s = elapsed() + options_.checkpoint_every_s;
  double last_rate_s = elapsed();
  std::uint64_t last_rate_rays = 0;
  double rays_per_s = 0;
  const auto reached = [&] {
    return options_.target_psnr > 0 && report_.heldout_psnr >= options_.target_psnr;
  };
  for (double now = elapsed(); Progress(now) < 1.0 && !reached(); now = elapsed()) {
    Step(Progress(now));
    if (state_.step == kCollapseStep && state_.restarts == 0 && HasCollapsed()) Restart();
    if (io::PendingInterrupt()) {
      Save(elapsed());
      io::ThrowIfInterrupted();
    }
    now = elapsed();
    if (now >= next_monitor_s) {
      const double before_s = excluded_s;
      excluding([&] { Monitor(now); });
      const double cost_s = excluded_s - before_s;
      const double growth = options_.target_psnr > 0 ? kTargetMonitorGrowth : kMonitorGrowth;
      next_monitor_s = std::max({now * growth, next_monitor_s, now + cost_s / kMonitorShare});
    }
    if (now >= next_save_s) {
      excluding([&] { Save(now); });
      next_save_s = now + options_.checkpoint_every_s;
    }
    if (now - last_rate_s > 0.5) {
      rays_per_s = static_cast<double>(n_rays_ - last_rate_rays) / (now - last_rate_s);
      last_rate_s = now;
      last_rate_rays = n_rays_;
      char heldout[40] = "", note[120];
      if (report_.heldout_psnr > 0)
        std::snprintf(heldout, sizeof heldout, "held-out %.2f dB  ", report_.heldout_psnr);
      const double train_db = -10 * std::log10(std::max(state_.squared_error, 1e-12));
      std::snprintf(note, sizeof note, "train %.2f dB  %s%.0f k rays/s", train_db, heldout, rays_per_s / 1e3);
      bar.Update(Progress(now), note);
    }
  }
  report_.budget_s = options_.time_s;
  report_.train_s = elapsed();
  Monitor(report_.train_s);
  Save(report_.train_s);
  const double this_run_s = std::max(report_.train_s - resumed_s, 1e-9);
  report_.steps = state_.step;
  report_.parameters = scene_field_->field->n_parameters();
  report_.samples_per_s = static_cast<double>(n_samples_) / this_run_s;
  report_.rays_per_s = static_cast<double>(n_rays_) / this_run_s;
  report_.samples_per_ray =
      static_cast<double>(n_samples_) / static_cast<double>(std::max<std::uint64_t>(n_rays_, 1));
  report_.gflops = flop_ * 1e-9 / this_run_s;
  if (flop_ > 0) report_.gemm_gflops = training_->GemmGflops();
  report_.occupied_share = scene_field_->grid.OccupiedShare();
  report_.skipped_steps = state_.skipped_steps;
  report_.restarts = state_.restarts;
  report_.arithmetic = training_->Arithmetic();
  return report_;
}

}  // namespace

TrainingSchedule ScheduleOf(const TrainOptions& options, bool has_alpha) {
  // What a thread of a processor with AVX-512 does; it only decides between a few capacities.
  constexpr double kSamplesPerThreadSecond = 1.5e6;
  TrainingSchedule schedule =
      options.schedule
          ? *options.schedule
          : ScheduleFor(options.steps > 0 ? 1.0 * options.steps * options.samples_per_step
                                          : options.time_s * options.threads * kSamplesPerThreadSecond);
  if (!has_alpha) schedule.pixel_rays_from = 1;
  if (options.learning_rate > 0) schedule.learning_rate = options.learning_rate;
  if (options.field.log2_hashmap_size > 0) schedule.log2_hashmap_size = options.field.log2_hashmap_size;
  return schedule;
}

TrainReport Train(const io::Scene& scene,
                  const io::Scene& heldout,
                  const TrainOptions& options,
                  const std::filesystem::path& folder) {
  PIPELINE_CHECK_GT(options.threads, 0);
  return Trainer(scene, heldout, options, folder).Run();
}

}  // namespace nerf
