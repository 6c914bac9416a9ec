#include "nerf/training/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "io/base/check.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "io/process/ranks.h"
#include "nerf/data/picture_gains.h"
#include "nerf/data/plain_background.h"
#include "nerf/data/sky.h"
#include "nerf/data/sparse_depth.h"
#include "nerf/training/field_fit.h"
#include "nerf/training/heldout_monitor.h"
#include "nerf/training/splat_fit.h"
#include "nerf/training/training_clock.h"
#include "nerf/training/training_memory.h"
#include "nerf/training/training_progress.h"
#include "nerf/training/transient_masks.h"

namespace nerf {
namespace {

constexpr double kMonitorGrowth = 1.5;        // monitoring moments grow geometrically ...
constexpr double kTargetMonitorGrowth = 1.1;  // (where they decide when to stop)
constexpr double kFirstMonitorS = 1.0;        // ... from one second of training on
constexpr double kMonitorShare = 0.2;         // and take at most this share of the training time
constexpr double kProgressEveryS = 0.5;
constexpr double kWatchedShare = 0.025;  // of the training time that a watcher's checkpoints take at most
constexpr double kWatchedEveryS = 4;     // and not more often, since reading them costs as well

// Shorter trainings are the field's alone: splats have no time to become as good (nerf/EXPERIMENTS.md).
constexpr double kShortestWithSplatsS = 12;

double Db(double squared_error) { return -10 * std::log10(std::max(squared_error, 1e-12)); }

// Training in parts, that of the field and that of the splats, with one clock.
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
        dataset_(LoadDataset(scene, options.threads, options.field.PixelOffset())),
        curve_(folder / "curve.csv") {}

  TrainReport Run();

 private:
  void Begin();
  void TrainField();
  void FitSplats();
  void AfterStep();
  // Of the part that is under way.
  std::uint64_t PartStep() const { return splats_ ? state_.splats.step : state_.step; }
  double Progress(double elapsed_s) const { return progress_->At(PartStep(), elapsed_s - part_begin_s_); }
  double TrainPsnr() const { return Db(splats_ ? state_.splats.squared_error : state_.squared_error); }
  double NextProgress();
  bool IsTargetReached() const;
  TrainingNews News(double now) const;
  void Monitor(double elapsed_s);
  void Save(double elapsed_s);
  void MonitorWhenDue(double now);
  void SaveWhenDue(double now);
  void AskWatcher(const TrainingNews& news);
  void ShowProgress(double now);
  void FillReport();

  TrainingClock clock_;  // from here on, the reading of the pictures included
  const io::Scene &scene_, &heldout_;
  TrainOptions options_;  // time_s: of the field
  const std::filesystem::path folder_;
  const io::Ranks& ranks_ = io::AllRanks();
  io::Workers workers_;
  Dataset dataset_;
  TrainState state_;
  TrainReport report_;
  std::optional<HeldoutMonitor> monitor_;
  TrainingCurve curve_;
  double budget_s_ = 0;  // of all parts
  bool plans_splats_ = false;
  std::optional<TransientMasks> transients_;
  std::optional<FieldFit> field_;
  std::optional<SplatFit> splats_;
  std::optional<TrainingProgress> progress_;
  double part_begin_s_ = 0;    // training time that is not the part's
  double field_run_s_ = 1e-9;  // of the field in this run; never zero
  double next_monitor_s_ = 0, next_save_s_ = 0;
  double next_watched_save_s_ = 0;
  std::optional<io::Progress> bar_;
  double shown_s_ = 0;            // when progress was last shown ...
  std::uint64_t shown_rays_ = 0;  // ... and the field's rays then
};

void Trainer::Begin() {
  const bool had_alpha = dataset_.channels == 4;
  MarkPlainBackground(&dataset_, options_.memory);
  if (dataset_.channels == 4 && !had_alpha) RequireHullMemory(dataset_, options_);
  if (dataset_.channels == 3) {
    dataset_.depths = SparseDepths(scene_, dataset_);
    if (options_.field.kind == FieldKind::kHash) dataset_.sky = FindSky(scene_, dataset_, &workers_);
    const auto n_sky = std::count(dataset_.sky.begin(), dataset_.sky.end(), true);
    if (n_sky > 0)
      report_.events.push_back(
          fmt::format("the pictures show the sky in {:.0f} % of their pixels: nothing stands before it",
                      100 * static_cast<double>(n_sky) / static_cast<double>(dataset_.n_pixels())));
    const PictureGains gains = FindPictureGains(dataset_);
    EvenOut(gains, &dataset_);
    if (!gains.empty())
      report_.events.push_back(
          fmt::format("brightness and tint change by {:.1f} % from picture to picture: evened out",
                      100 * SpreadOf(gains)));
  }
  const std::filesystem::path checkpoint = folder_ / "checkpoint.bin";
  std::unique_ptr<SceneField> scene_field;
  if (io::FromFirst(std::filesystem::exists(checkpoint))) {
    scene_field = ReadCheckpoint(checkpoint, &state_);
    if (options_.target_psnr > 0) options_.time_s = state_.budget_s;
    report_.events.push_back(fmt::format("resumed at step {}", state_.step));
  } else {
    state_.seed = options_.seed;
    state_.budget_s = options_.time_s;
    state_.channels = dataset_.channels;
  }
  budget_s_ = options_.time_s;
  const bool is_long = options_.steps > 0 || budget_s_ >= kShortestWithSplatsS;
  plans_splats_ = options_.splats && SplatFit::Suits(dataset_, options_.field.kind) && is_long;
  if (plans_splats_) options_.time_s *= kFieldShare;
  field_.emplace(scene_, options_, std::move(scene_field), &dataset_, &state_, &report_, &workers_);
  // After the field, which takes its constants from all pixels, resumed or not.
  if (options_.find_transients && dataset_.channels == 3 && options_.field.kind == FieldKind::kHash &&
      is_long)
    transients_.emplace(scene_, &dataset_, &state_, &workers_);
  clock_.Resume(state_.elapsed_s);
  if (ranks_.IsFirst())
    clock_.Exclude([&] { monitor_.emplace(heldout_, options_.threads, options_.field.PixelOffset()); });
  next_monitor_s_ = std::max(kFirstMonitorS, state_.elapsed_s * kMonitorGrowth);
  bar_.emplace("train");
  shown_s_ = clock_.Elapsed();
  next_save_s_ = shown_s_ + options_.checkpoint_every_s;
}

bool Trainer::IsTargetReached() const {
  return options_.target_psnr > 0 && report_.heldout_psnr >= options_.target_psnr;
}

// Of the step to come, as rank 0 sees it; 1 ends the part.
double Trainer::NextProgress() { return io::FromFirst(IsTargetReached() ? 1.0 : Progress(clock_.Elapsed())); }

TrainingNews Trainer::News(double now) const {
  const double part_s = now - part_begin_s_;
  TrainingNews news{.step = state_.step,
                    .progress = Progress(now),
                    .elapsed_s = now,
                    .left_s = progress_->LeftSeconds(PartStep(), part_s),
                    .train_psnr = TrainPsnr(),
                    .heldout_psnr = report_.heldout_psnr};
  if (!plans_splats_) return news;
  if (splats_) {
    news.progress = kFieldShare + (1 - kFieldShare) * news.progress;
  } else {
    news.progress *= kFieldShare;
    if (!report_.ended_early) news.left_s += (part_s + news.left_s) * (1 / kFieldShare - 1);
  }
  return news;
}

void Trainer::Monitor(double elapsed_s) {
  CurvePoint point{
      .step = state_.step, .wall_s = elapsed_s, .cpu_s = clock_.CpuElapsed(), .loss = field_->loss()};
  point.train_psnr = TrainPsnr();
  point.heldout_psnr = monitor_->Psnr(*field_->scene_field(), &workers_);
  report_.curve.push_back(point);
  curve_.Add(point);
  report_.heldout_psnr = point.heldout_psnr;
}

void Trainer::Save(double elapsed_s) {
  state_.elapsed_s = elapsed_s;
  if (!splats_) state_.field_s = elapsed_s - part_begin_s_;
  WriteCheckpoint(folder_ / "checkpoint.bin", field_->scene_field(), state_);
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

void Trainer::AskWatcher(const TrainingNews& news) {
  if (!options_.watcher) return;
  const double now = news.elapsed_s;
  const WatcherWish wish = options_.watcher(news);
  if (wish.wants_end && !report_.ended_early) {
    report_.ended_early = true;
    report_.events.push_back(fmt::format("asked to end at {:.0f} % by a viewer", 100 * news.progress));
    progress_->End(PartStep(), now - part_begin_s_);
  } else if (wish.wants_checkpoint && now >= next_watched_save_s_) {
    const double cost_s = clock_.Exclude([&] { Save(now); });
    next_watched_save_s_ = now + std::max(kWatchedEveryS, cost_s / kWatchedShare);
  }
}

void Trainer::ShowProgress(double now) {
  if (now - shown_s_ <= kProgressEveryS) return;
  const TrainingNews news = News(now);
  AskWatcher(news);
  const double rays_per_s = static_cast<double>(field_->n_rays() - shown_rays_) / (now - shown_s_);
  shown_s_ = now;
  shown_rays_ = field_->n_rays();
  std::string heldout;
  if (report_.heldout_psnr > 0) heldout = fmt::format("held-out {:.2f} dB  ", report_.heldout_psnr);
  bar_->Update(news.progress,
               fmt::format("train {:.2f} dB  {}", news.train_psnr, heldout) +
                   (splats_ ? fmt::format("splats, step {}", PartStep())
                            : fmt::format("{:.0f} k rays/s", rays_per_s / 1e3)));
}

void Trainer::AfterStep() {
  io::ThrowIfInterrupted();
  if (!ranks_.IsFirst()) return;
  const double now = clock_.Elapsed();
  MonitorWhenDue(now);
  SaveWhenDue(now);
  ShowProgress(now);
}

void Trainer::TrainField() {
  const double begin_s = state_.field_s;
  part_begin_s_ = state_.elapsed_s - begin_s;
  progress_.emplace(options_.steps, options_.time_s);
  for (double progress = NextProgress(); progress < 1; progress = NextProgress()) {
    field_->scene_field()->splats = {};  // of a field that was trained less
    state_.splats = {};
    if (transients_) transients_->BeforeStep(*field_);
    field_->Step(progress);
    AfterStep();
  }
  field_->scene_field()->step_scale = 1;
  field_->scene_field()->field->Refresh();  // as when it is read: an interruption here changes no splat
  state_.field_s = clock_.Elapsed() - part_begin_s_;
  field_run_s_ += state_.field_s - begin_s;
}

void Trainer::FitSplats() {
  const bool is_finished = state_.splats.step > 0 && state_.splats.moments.empty();
  if (is_finished || io::FromFirst(IsTargetReached())) return;
  const double now = clock_.Elapsed();
  if (state_.splats.step == 0) state_.splats.begin_s = now;
  const bool ends_early = io::FromFirst(report_.ended_early);
  const double shortest_s = std::max(TrainingProgress::kMinWindDownS, TrainingProgress::kWindDownShare * now);
  progress_.emplace(options_.steps > 0 && !ends_early ? 1 + options_.steps / kFieldSteps : 0,
                    ends_early ? shortest_s : std::max(budget_s_ - state_.splats.begin_s, shortest_s));
  splats_.emplace(scene_, dataset_, field_->WorldFromCam(), field_->scene_field(), &state_, &workers_);
  part_begin_s_ = state_.splats.begin_s;
  for (double progress = NextProgress(); progress < 1; progress = NextProgress()) {
    splats_->Step(progress);
    AfterStep();
  }
  report_.events.push_back(splats_->Finish());
}

void Trainer::FillReport() {
  report_.heldout_psnr = io::FromFirst(report_.heldout_psnr);  // whether a target is reached, and whether
  report_.ended_early = io::FromFirst(report_.ended_early);    // training ends, concerns all ranks
  report_.budget_s = budget_s_;
  field_->FillReport(field_run_s_);
  if (!transients_) return;
  report_.masks = transients_->Masks();
  if (const std::string found = transients_->Describe(); !found.empty()) report_.events.push_back(found);
}

TrainReport Trainer::Run() {
  Begin();
  try {
    TrainField();
    if (plans_splats_) FitSplats();
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
