#include "nerf/training/splat_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/base/median.h"
#include "nerf/training/field_surface.h"
#include "nerf/training/splat_shares.h"

namespace nerf {
namespace {

constexpr std::size_t kMaxSplats = 200000;
// Used pixels of all pictures per splat, at least.
constexpr std::size_t kPixelsPerSplat = 4;
// When the pictures that were set aside are looked at, as a share of the fit.
constexpr double kJudgedAt = 0.5;
constexpr double kLeastError = 1e-6;  // 60 dB: below, 8 bits tell nothing
constexpr double kErrorDecay = 0.98;  // running mean of the squared error, about 50 steps
// Squared error of a field on pictures that it has not seen, over that on its training rays: half of what the
// splats' is, within what fields had in dense captures and in sparse ones.
constexpr double kFieldRatioPerSplats = 0.5, kLeastFieldRatio = 2, kMostFieldRatio = 4.5;
// Splats have no more: where few photographs look, beside those that were set aside, the field is steadier.
constexpr double kMostShare = 0.8;
// With less, they are not worth the time that they take in every picture.
constexpr double kLeastShare = 0.1;
// Pixels of training views in which the field stands before the splats: at most 0.4 % by floaters of the
// field in seven captures; 2 to 5 % on a street whose houses two photos show, where it is the splats that
// have holes.
constexpr double kMostFloaters = 0.008, kLeastHoles = 0.016;

// Of the picture's pixels.
double ShownShare(const SplatTarget& target) {
  const std::size_t n = target.rgba.size() / 4;
  double shown = 0;
  for (std::size_t i = 0; i < n; ++i) shown += IsShown(target, i);
  return std::max(shown, 1.0) / static_cast<double>(n);
}

}  // namespace

std::size_t SplatFit::Number(std::size_t n_pixels) {
  return std::min(kMaxSplats, n_pixels / kPixelsPerSplat);
}

std::size_t SplatFit::Bytes(std::size_t n_pixels) {
  // Values, moments, gradients, a copy while a checkpoint is written; and in the picture of a room, which
  // each splat meets in a few tiles, their places and gradients.
  constexpr std::size_t kPerSplat = 23 * sizeof(float) * 6, kInPicture = 600;
  return Number(n_pixels) * (kPerSplat + kInPicture);
}

SplatFit::SplatFit(const io::Scene& scene,
                   const Dataset& dataset,
                   std::vector<io::Rigid3d> world_from_cam,
                   SceneField* scene_field,
                   TrainState* state,
                   io::Workers* workers)
    : dataset_(dataset),
      photos_(scene, dataset, std::move(world_from_cam), *scene_field),
      scene_field_(scene_field),
      state_(state),
      workers_(workers) {
  if (state->splats.moments.empty()) Begin();
  for (std::size_t view = 0; view < dataset.views.size(); ++view) {
    const bool is_aside = view % kJudgedEvery == kJudgedEvery / 2;
    if (is_aside) aside_.push_back(view);
    if (!is_aside || state->splats.is_judged) fitted_.push_back(view);
  }
  adam_.emplace(&scene_field->splats, &state->splats.moments, workers);
}

void SplatFit::Begin() {
  const std::size_t number = Number(dataset_.n_used());
  scene_field_->splat_shares = {};
  scene_field_->splats = SplatsOn(FieldSurface(*scene_field_, dataset_, number, state_->seed, workers_));
  scene_field_->splat_focal_px = static_cast<float>(photos_.FocalLength());
  state_->splats.moments = FirstMoments(scene_field_->splats);
}

void SplatFit::Step(double progress) {
  if (!state_->splats.is_judged && progress >= kJudgedAt) Judge();
  SplatState& splats = state_->splats;
  const std::size_t view = fitted_[SplatTurn(fitted_.size(), state_->seed, splats.step)];
  const SplatTarget target = photos_.Target(view);
  const double mse = adam_->Step(target, SplatBackground(state_->seed, splats.step), splats.step, progress) /
                     ShownShare(target);
  splats.squared_error =
      splats.squared_error < 0 ? mse : kErrorDecay * splats.squared_error + (1 - kErrorDecay) * mse;
  ++splats.step;
  ChooseShare();
}

// Of two pictures with independent errors the mean by the inverse of these is the best. On pictures that
// neither has seen, the errors are larger than those of training.
void SplatFit::ChooseShare() {
  const double ratio = state_->splats.error_ratio;
  const double field = std::clamp(kFieldRatioPerSplats * ratio, kLeastFieldRatio, kMostFieldRatio) *
                       state_->squared_error,
               splats = ratio * state_->splats.squared_error;
  scene_field_->splat_share = static_cast<float>(std::min(kMostShare, field / (field + splats)));
}

std::string SplatFit::Finish() {
  SplatState& state = state_->splats;
  RequireFinite(scene_field_->splats);
  const double share = scene_field_->splat_share,
               before = FieldBeforeShare(*scene_field_, photos_, fitted_, workers_);
  scene_field_->splat_share_behind =
      static_cast<float>(std::clamp((kLeastHoles - before) / (kLeastHoles - kMostFloaters), 0.0, 1.0));
  if (share >= kLeastShare)
    scene_field_->splat_shares = SharesByPlace(*scene_field_, photos_, fitted_, workers_);
  state.moments = {};  // from here on it is finished: what may be interrupted comes before
  std::string text = fmt::format(
      "{} splats in {} steps, {:.0f} % of the picture, {:.0f} % where the field stands "
      "before them ({:.1f} % of the pixels)",
      scene_field_->splats.size(),
      state.step,
      100 * share,
      100 * std::max<double>(share, scene_field_->splat_share_behind),
      100 * before);
  if (state.is_judged)
    text += fmt::format("; {:.1f} times the squared error on {} pictures that were set aside",
                        state.error_ratio,
                        aside_.size());
  if (share >= kLeastShare) return text;
  scene_field_->splats = {};
  scene_field_->splat_share_behind = 0;
  return text + "; dropped, for so little is not worth its time";
}

// Over the pixels of a view that splats are to show, before black.
double SplatFit::SquaredError(std::size_t index) {
  const SplatTarget target = photos_.Target(index);
  const SplatPicture picture = SplatRasteriser(workers_).Render(scene_field_->splats, target.view);
  double sum = 0;
  std::size_t n = 0;
  for (std::size_t i = 0; i < picture.transmittance.size(); ++i) {
    if (!IsShown(target, i)) continue;
    ++n;
    for (std::size_t c = 0; c < 3; ++c) {
      const double error = picture.rgb[3 * i + c] - target.rgba[4 * i + c] / 255.f;
      sum += error * error;
    }
  }
  return sum / static_cast<double>(3 * std::max<std::size_t>(n, 1));
}

void SplatFit::Judge() {
  std::vector<double> ratios;
  for (const std::size_t view : aside_) {
    const std::size_t after = view + 1 < dataset_.views.size() ? view + 1 : view - 1;
    const double beside = 0.5 * (SquaredError(view - 1) + SquaredError(after));
    ratios.push_back(SquaredError(view) / std::max(beside, kLeastError));
  }
  state_->splats.is_judged = true;
  state_->splats.error_ratio = io::Median(std::move(ratios));
  fitted_.insert(fitted_.end(), aside_.begin(), aside_.end());
  std::sort(fitted_.begin(), fitted_.end());
}

}  // namespace nerf
