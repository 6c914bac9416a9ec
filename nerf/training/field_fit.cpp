#include "nerf/training/field_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/base/error.h"
#include "nerf/data/capture_geometry.h"
#include "nerf/data/hull_pixels.h"
#include "nerf/training/heldout_monitor.h"

namespace nerf {
namespace {

constexpr double kLossDecay = 0.98;           // running mean of the squared error, about 50 steps
constexpr std::uint64_t kCollapseStep = 500;  // by then a living field is far above a constant picture
constexpr double kCollapseMarginDb = 0.1, kCollapseOpacity = 1e-3;
constexpr int kMaxSkippedSteps = 3;

// What the steps need to know of a kind of field.
struct TrainingKind {
  FieldKind kind;
  decltype(&MakeHashTraining) make;
  bool has_schedule;  // that of training_schedule.h
  bool has_capture_terms;
  bool drops_idle_pixels;  // those whose rays meet no cell of the visual hull
};
constexpr TrainingKind kTrainingKinds[] = {{FieldKind::kHash, MakeHashTraining, true, true, true},
                                           {FieldKind::kMlp, MakeMlpTraining, false, false, false}};

const TrainingKind& KindOf(FieldKind kind) { return kTrainingKinds[static_cast<std::size_t>(kind)]; }

}  // namespace

FieldFit::FieldFit(const io::Scene& scene,
                   const TrainOptions& options,
                   std::unique_ptr<SceneField> scene_field,
                   Dataset* dataset,
                   TrainState* state,
                   TrainReport* report,
                   io::Workers* workers)
    : scene_(scene),
      options_(options),
      dataset_(dataset),
      state_(state),
      report_(report),
      workers_(workers),
      scene_field_(std::move(scene_field)) {
  scene_field_ ? MakeTraining() : MakeField();
  const bool white = options.field.kind == FieldKind::kMlp && options.mlp.white_background;
  constant_squared_error_ = ConstantSquaredError(*dataset, white ? 1.0 : 0.5);
}

void FieldFit::MakeTraining() {
  const TrainingKind& kind = KindOf(options_.field.kind);
  if (kind.drops_idle_pixels && dataset_->channels == 4) {
    DropPixelsBesideHull(
        scene_, scene_field_->contraction, scene_field_->grid.resolution(), workers_, dataset_);
  }
  CaptureTerms terms;
  if (kind.has_capture_terms && scene_field_->contraction.unbounded) {
    const SceneContraction& contraction = scene_field_->contraction;
    terms.near_cameras = &near_cameras_.emplace(scene_, contraction, contraction.half, workers_);
    if (options_.refine_cameras)
      terms.refinement =
          &refinement_.emplace(scene_, contraction, options_.field.PixelOffset(), dataset_, &state_->cameras);
  }
  training_ = kind.make(*dataset_, options_, scene_field_.get(), workers_, terms);
}

void FieldFit::MakeField() {
  const TrainingSchedule schedule = ScheduleOf(options_, dataset_->channels == 4);
  SceneFieldOptions field = options_.field;
  field.log2_hashmap_size = schedule.log2_hashmap_size;
  field.finest_cell_pixels = schedule.finest_cell_pixels;
  field.entry_moments = schedule.entry_moments;
  scene_field_ = MakeSceneField(scene_, *dataset_, field, state_->seed, workers_, &report_->derivation);
  if (KindOf(options_.field.kind).has_schedule)
    report_->events.push_back("schedule for this budget: " + schedule.Text());
  MakeTraining();
}

void FieldFit::Step(double progress) {
  const StepOutcome outcome = training_->Step(progress, state_);
  loss_ = outcome.loss;
  opacity_ = outcome.opacity;
  if (outcome.fault.empty()) {
    n_samples_ += outcome.n_samples;
    n_rays_ += outcome.n_rays;
    flop_ += outcome.flop;
    const double before = state_->squared_error, now = outcome.squared_error;
    state_->squared_error = before < 0 ? now : kLossDecay * before + (1 - kLossDecay) * now;
  } else {
    Skip(outcome.fault);
  }
  ++state_->step;
  if (state_->step == kCollapseStep && state_->restarts == 0 && HasCollapsed()) Restart();
}

void FieldFit::Skip(const std::string& fault) {
  const std::string where = fmt::format("{}, step {}, seed {}", fault, state_->step, state_->seed);
  if (++state_->skipped_steps > kMaxSkippedSteps) {
    throw io::Error(io::ExitCode::kNumeric, "not finite: " + where, "Lower --learning-rate or change --seed");
  }
  report_->events.push_back("skipped a step that was not finite: " + where + "; learning rate halved");
  state_->learning_rate_scale *= 0.5;
}

bool FieldFit::HasCollapsed() const {
  const double gain_db = 10 * std::log10(constant_squared_error_ / state_->squared_error);
  return opacity_ < kCollapseOpacity || gain_db < kCollapseMarginDb;
}

void FieldFit::Restart() {
  report_->events.push_back(fmt::format(
      "collapsed by step {} with seed {}; restarted with the next seed", state_->step, state_->seed));
  TrainState fresh;
  fresh.seed = state_->seed + 1;
  fresh.restarts = state_->restarts + 1;
  fresh.channels = state_->channels;
  fresh.budget_s = state_->budget_s;
  *state_ = fresh;
  MakeField();
}

std::vector<io::Rigid3d> FieldFit::WorldFromCam() const {
  return refinement_ ? refinement_->WorldFromCam() : PosesOf(scene_);
}

void FieldFit::FillReport(double seconds) const {
  TrainReport& report = *report_;
  report.steps = state_->step;
  report.parameters = scene_field_->field->n_parameters();
  report.samples_per_s = static_cast<double>(n_samples_) / seconds;
  report.rays_per_s = static_cast<double>(n_rays_) / seconds;
  report.samples_per_ray =
      static_cast<double>(n_samples_) / static_cast<double>(std::max<std::uint64_t>(n_rays_, 1));
  report.gflops = flop_ * 1e-9 / seconds;
  if (flop_ > 0) report.gemm_gflops = training_->GemmGflops();
  report.occupied_share = scene_field_->grid.OccupiedShare();
  report.skipped_steps = state_->skipped_steps;
  report.restarts = state_->restarts;
  report.arithmetic = training_->Arithmetic();
  if (!refinement_) return;
  report.moved_cameras = MovedCameras(scene_, *refinement_);
  report.events.push_back(Describe(report.moved_cameras, scene_.frames.size()));
}

}  // namespace nerf
