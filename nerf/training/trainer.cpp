#include "nerf/training/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/base/check.h"
#include "io/base/interrupt.h"
#include "io/base/progress.h"
#include "io/base/ranks.h"
#include "nerf/data/hull_pixels.h"
#include "nerf/data/near_cameras.h"
#include "nerf/data/plain_background.h"
#include "nerf/data/sparse_depth.h"
#include "nerf/training/camera_refinement.h"
#include "nerf/training/field_training.h"
#include "nerf/training/heldout_monitor.h"
#include "nerf/training/training_clock.h"
#include "nerf/training/training_memory.h"
#include "nerf/training/training_progress.h"

namespace nerf {
namespace {

constexpr double kLossDecay = 0.98;           // running mean of the squared error, about 50 steps
constexpr std::uint64_t kCollapseStep = 500;  // by then a living field is far above a constant picture
constexpr double kCollapseMarginDb = 0.1, kCollapseOpacity = 1e-3;
constexpr int kMaxSkippedSteps = 3;
constexpr double kMonitorGrowth = 1.5;        // monitoring moments grow geometrically ...
constexpr double kTargetMonitorGrowth = 1.1;  // (where they decide when to stop)
constexpr double kFirstMonitorS = 1.0;        // ... from one second of training on
constexpr double kMonitorShare = 0.2;         // and take at most this share of the training time
constexpr double kProgressEveryS = 0.5;
constexpr double kWatchedShare = 0.05;  // of the training time that a watcher's checkpoints take at most
constexpr double kWatchedEveryS = 4;    // and not more often, since reading them costs as well

double Db(double squared_error) { return -10 * std::log10(std::max(squared_error, 1e-12)); }

// What the loop needs to know of a kind of field.
struct TrainingKind {
  FieldKind kind;
  decltype(&MakeHashTraining) make;
  bool has_schedule;  // that of training_schedule.h
  bool has_capture_terms;
  bool drops_idle_pixels;  // those whose rays meet no cell of the visual hull
};
constexpr TrainingKind kTrainingKinds[] = {{FieldKind::kHash, MakeHashTraining, true, true, true},
                                           {FieldKind::kMlp, MakeMlpTraining, false, false, false}};

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
        kind_(kTrainingKinds[static_cast<std::size_t>(options.field.kind)]),
        workers_(options.threads),
        dataset_(LoadDataset(scene, options.threads, options.field.PixelOffset())),
        curve_(folder / "curve.csv") {}

  TrainReport Run();

 private:
  void Begin();
  void MakeField();
  void MakeTraining();
  double Progress(double elapsed_s) const { return progress_.At(state_.step, elapsed_s); }
  double NextProgress();
  void Step(double progress);
  void Skip(const std::string& fault);
  bool HasCollapsed() const;
  void Restart();
  void Monitor(double elapsed_s);
  void Save(double elapsed_s);
  void MonitorWhenDue(double now);
  void SaveWhenDue(double now);
  void ShowProgress(double now);
  void AskWatcher(double now);
  void FillReport();

  TrainingClock clock_;  // from here on, the reading of the pictures included
  const io::Scene &scene_, &heldout_;
  TrainOptions options_;
  const std::filesystem::path folder_;
  const TrainingKind& kind_;
  const io::Ranks& ranks_ = io::AllRanks();
  io::Workers workers_;
  Dataset dataset_;
  std::optional<HeldoutMonitor> monitor_;
  std::unique_ptr<SceneField> scene_field_;
  TrainState state_;
  TrainingCurve curve_;
  std::optional<NearCameras> near_cameras_;     // of photographs ...
  std::optional<CameraRefinement> refinement_;  // ... whose cameras may move
  std::unique_ptr<FieldTraining> training_;
  TrainingProgress progress_{options_};
  TrainReport report_;
  double loss_ = 0, opacity_ = 0;
  double constant_squared_error_ = 0;
  std::uint64_t n_samples_ = 0, n_rays_ = 0;
  double flop_ = 0;
  double next_monitor_s_ = 0, next_save_s_ = 0;
  double next_watched_save_s_ = 0;
  std::optional<io::Progress> bar_;
  double shown_s_ = 0;            // when progress was last shown ...
  std::uint64_t shown_rays_ = 0;  // ... and n_rays_ then
};

void Trainer::MakeTraining() {
  if (kind_.drops_idle_pixels && dataset_.channels == 4) {
    DropPixelsBesideHull(
        scene_, scene_field_->contraction, scene_field_->grid.resolution(), &workers_, &dataset_);
  }
  CaptureTerms terms;
  if (kind_.has_capture_terms && scene_field_->contraction.unbounded) {
    const SceneContraction& contraction = scene_field_->contraction;
    terms.near_cameras = &near_cameras_.emplace(scene_, contraction, contraction.half, &workers_);
    if (options_.refine_cameras)
      terms.refinement =
          &refinement_.emplace(scene_, contraction, options_.field.PixelOffset(), &dataset_, &state_.cameras);
  }
  training_ = kind_.make(dataset_, options_, scene_field_.get(), &workers_, terms);
}

void Trainer::MakeField() {
  const TrainingSchedule schedule = ScheduleOf(options_, dataset_.channels == 4);
  SceneFieldOptions field = options_.field;
  field.log2_hashmap_size = schedule.log2_hashmap_size;
  field.finest_cell_pixels = schedule.finest_cell_pixels;
  field.entry_moments = schedule.entry_moments;
  scene_field_ = MakeSceneField(scene_, dataset_, field, state_.seed, &workers_, &report_.derivation);
  if (kind_.has_schedule) report_.events.push_back("schedule for this budget: " + schedule.Text());
  MakeTraining();
}

void Trainer::Begin() {
  const bool had_alpha = dataset_.channels == 4;
  MarkPlainBackground(&dataset_, options_.memory);
  if (dataset_.channels == 4 && !had_alpha) RequireHullMemory(dataset_, options_);
  if (dataset_.channels == 3) dataset_.depths = SparseDepths(scene_, dataset_);
  const std::filesystem::path checkpoint = folder_ / "checkpoint.bin";
  if (io::FromFirst(std::filesystem::exists(checkpoint))) {
    scene_field_ = ReadCheckpoint(checkpoint, &state_);
    if (options_.target_psnr > 0) options_.time_s = state_.budget_s;
    report_.events.push_back(fmt::format("resumed at step {}", state_.step));
    MakeTraining();
  } else {
    state_.seed = options_.seed;
    state_.budget_s = options_.time_s;
    state_.channels = dataset_.channels;
    MakeField();
  }
  const bool white = kind_.kind == FieldKind::kMlp && options_.mlp.white_background;
  constant_squared_error_ = ConstantSquaredError(dataset_, white ? 1.0 : 0.5);
  clock_.Resume(state_.elapsed_s);
  if (ranks_.IsFirst())
    clock_.Exclude([&] { monitor_.emplace(heldout_, options_.threads, options_.field.PixelOffset()); });
  next_monitor_s_ = std::max(kFirstMonitorS, state_.elapsed_s * kMonitorGrowth);
  bar_.emplace("train");
  shown_s_ = clock_.Elapsed();
  next_save_s_ = shown_s_ + options_.checkpoint_every_s;
}

// Of the step to come, as rank 0 sees it; 1 ends the training.
double Trainer::NextProgress() {
  const bool is_reached = options_.target_psnr > 0 && report_.heldout_psnr >= options_.target_psnr;
  return io::FromFirst(is_reached ? 1.0 : Progress(clock_.Elapsed()));
}

void Trainer::Step(double progress) {
  const StepOutcome outcome = training_->Step(progress, &state_);
  loss_ = outcome.loss;
  opacity_ = outcome.opacity;
  if (outcome.fault.empty()) {
    n_samples_ += outcome.n_samples;
    n_rays_ += outcome.n_rays;
    flop_ += outcome.flop;
    state_.squared_error = state_.squared_error < 0
                               ? outcome.squared_error
                               : kLossDecay * state_.squared_error + (1 - kLossDecay) * outcome.squared_error;
  } else {
    Skip(outcome.fault);
  }
  ++state_.step;
}

void Trainer::Skip(const std::string& fault) {
  const std::string where = fmt::format("{}, step {}, seed {}", fault, state_.step, state_.seed);
  if (++state_.skipped_steps > kMaxSkippedSteps) {
    throw io::Error(io::ExitCode::kNumeric, "not finite: " + where, "Lower --learning-rate or change --seed");
  }
  report_.events.push_back("skipped a step that was not finite: " + where + "; learning rate halved");
  state_.learning_rate_scale *= 0.5;
}

bool Trainer::HasCollapsed() const {
  const double gain_db = 10 * std::log10(constant_squared_error_ / state_.squared_error);
  return opacity_ < kCollapseOpacity || gain_db < kCollapseMarginDb;
}

void Trainer::Restart() {
  report_.events.push_back(fmt::format(
      "collapsed by step {} with seed {}; restarted with the next seed", state_.step, state_.seed));
  TrainState fresh;
  fresh.seed = state_.seed + 1;
  fresh.restarts = state_.restarts + 1;
  fresh.channels = state_.channels;
  fresh.budget_s = state_.budget_s;
  state_ = fresh;
  MakeField();
}

void Trainer::Monitor(double elapsed_s) {
  CurvePoint point{.step = state_.step, .wall_s = elapsed_s, .cpu_s = clock_.CpuElapsed(), .loss = loss_};
  point.train_psnr = Db(state_.squared_error);
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

void Trainer::MonitorWhenDue(double now) {
  if (now < next_monitor_s_) return;
  const double cost_s = clock_.Exclude([&] { Monitor(now); });
  const double growth = options_.target_psnr > 0 ? kTargetMonitorGrowth : kMonitorGrowth;
  next_monitor_s_ = std::max({now * growth, next_monitor_s_, now + cost_s / kMonitorShare});
}

void Trainer::SaveWhenDue(double now) {
  if (now < next_save_s_) return;
  clock_.Exclude([&] { Save(now); });
  next_save_s_ = now + options_.checkpoint_every_s;
}

void Trainer::AskWatcher(double now) {
  if (!options_.watcher) return;
  const double progress = Progress(now);
  const WatcherWish wish = options_.watcher({.step = state_.step,
                                             .progress = progress,
                                             .elapsed_s = now,
                                             .left_s = progress_.LeftSeconds(state_.step, now),
                                             .train_psnr = Db(state_.squared_error),
                                             .heldout_psnr = report_.heldout_psnr});
  if (wish.wants_end && !report_.ended_early) {
    report_.ended_early = true;
    report_.events.push_back(fmt::format("asked to end at {:.0f} % by a viewer", 100 * progress));
    progress_.End(state_.step, now);
  } else if (wish.wants_checkpoint && now >= next_watched_save_s_) {
    const double cost_s = clock_.Exclude([&] { Save(now); });
    next_watched_save_s_ = now + std::max(kWatchedEveryS, cost_s / kWatchedShare);
  }
}

void Trainer::ShowProgress(double now) {
  if (now - shown_s_ <= kProgressEveryS) return;
  AskWatcher(now);
  const double rays_per_s = static_cast<double>(n_rays_ - shown_rays_) / (now - shown_s_);
  shown_s_ = now;
  shown_rays_ = n_rays_;
  std::string heldout;
  if (report_.heldout_psnr > 0) heldout = fmt::format("held-out {:.2f} dB  ", report_.heldout_psnr);
  bar_->Update(
      Progress(now),
      fmt::format("train {:.2f} dB  {}{:.0f} k rays/s", Db(state_.squared_error), heldout, rays_per_s / 1e3));
}

void Trainer::FillReport() {
  report_.heldout_psnr = io::FromFirst(report_.heldout_psnr);  // whether a target is reached, and whether
  report_.ended_early = io::FromFirst(report_.ended_early);    // training ends, concerns all ranks
  const double this_run_s = std::max(report_.train_s - clock_.resumed_s(), 1e-9);
  report_.budget_s = options_.time_s;
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
  if (!refinement_) return;
  report_.moved_cameras = MovedCameras(scene_, *refinement_);
  report_.events.push_back(Describe(report_.moved_cameras, scene_.frames.size()));
}

TrainReport Trainer::Run() {
  Begin();
  try {
    for (double progress = NextProgress(); progress < 1; progress = NextProgress()) {
      Step(progress);
      if (state_.step == kCollapseStep && state_.restarts == 0 && HasCollapsed()) Restart();
      io::ThrowIfInterrupted();
      if (!ranks_.IsFirst()) continue;
      const double now = clock_.Elapsed();
      MonitorWhenDue(now);
      SaveWhenDue(now);
      ShowProgress(now);
    }
    report_.train_s = clock_.Elapsed();
    if (ranks_.IsFirst()) Monitor(report_.train_s);
  } catch (const io::Interrupted&) {  // a step that was cut short has changed nothing
    if (ranks_.IsFirst()) Save(clock_.Elapsed());
    throw;
  }
  if (ranks_.IsFirst()) Save(report_.train_s);
  FillReport();
  return report_;
}

}  // namespace

TrainReport Train(const io::Scene& scene,
                  const io::Scene& heldout,
                  const TrainOptions& options,
                  const std::filesystem::path& folder) {
  PIPELINE_CHECK_GT(options.threads, 0);
  RequireTrainingMemory(scene, options);
  return Trainer(scene, heldout, options, folder).Run();
}

}  // namespace nerf
