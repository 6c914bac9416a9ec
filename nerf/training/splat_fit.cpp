#include "nerf/training/splat_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/base/median.h"
#include "nerf/rendering/ray_renderer.h"
#include "nerf/rendering/splat_mixing.h"
#include "nerf/rendering/support_map.h"
#include "nerf/training/field_surface.h"

namespace nerf {
namespace {

constexpr std::size_t kMaxSplats = 200000;
// Used pixels of all pictures per splat, at least.
constexpr std::size_t kPixelsPerSplat = 4;
// Longer side of the pictures that splats are fitted to, in pixels.
constexpr int kFitSide = 512;
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
constexpr std::size_t kViewsLookedAt = 8;

// Whether the splats are to show a pixel: it is used, and no sky.
bool IsShown(const SplatTarget& target, std::size_t pixel) {
  return (target.used.empty() || target.used[pixel]) && target.rgba[4 * pixel + 3] > 0;
}

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
    : scene_(scene),
      dataset_(dataset),
      world_from_cam_(std::move(world_from_cam)),
      used_(dataset.UsedPixels()),
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
  scene_field_->splats = SplatsOn(FieldSurface(*scene_field_, dataset_, number, state_->seed, workers_));
  std::vector<double> focal_lengths;
  for (const io::Frame& frame : scene_.frames)
    focal_lengths.push_back(
        SmallCamera(scene_.cameras[static_cast<std::size_t>(frame.camera_index)], kFitSide).fl_x);
  scene_field_->splat_focal_px = static_cast<float>(io::Median(std::move(focal_lengths)));
  state_->splats.moments = FirstMoments(scene_field_->splats);
}

SplatTarget SplatFit::Target(std::size_t index) const {
  const View& view = dataset_.views[index];
  // The sky is left to the field behind the splats.
  io::Image photo{.width = view.width, .height = view.height, .channels = 4};
  photo.data.reserve(4 * view.n_pixels());
  for (std::size_t i = view.first_pixel; i < view.first_pixel + view.n_pixels(); ++i) {
    photo.data.insert(photo.data.end(), &dataset_.pixels[3 * i], &dataset_.pixels[3 * i] + 3);
    photo.data.push_back(dataset_.ShowsSky(i) ? 0 : 255);
  }
  io::Mask mask{.width = view.width, .height = view.height, .used = {}};
  for (std::size_t i = 0; i < view.n_pixels() && !used_.empty(); ++i)
    mask.used.push_back(used_[view.first_pixel + i] ? 255 : 0);

  const io::Frame& frame = scene_.frames[index];
  const io::Camera camera =
      SmallCamera(scene_.cameras[static_cast<std::size_t>(frame.camera_index)], kFitSide);
  if (camera.width != photo.width || camera.height != photo.height) {
    photo = io::ResizeArea(photo, camera.width, camera.height);
    if (!mask.used.empty()) mask = io::ShrinkMask(mask, camera.width, camera.height);
  }
  SplatTarget target{SplatViewOf(*scene_field_, camera, world_from_cam_[index]), {}, {}};
  for (std::size_t i = 0; i < photo.data.size() / 4; ++i) {
    const int alpha = photo.data[4 * i + 3];
    for (std::size_t c = 0; c < 3; ++c)
      target.rgba.push_back(static_cast<std::uint8_t>((photo.data[4 * i + c] * alpha + 127) / 255));
    target.rgba.push_back(photo.data[4 * i + 3]);
    if (!mask.used.empty()) target.used.push_back(mask.Uses(i));
  }
  return target;
}

void SplatFit::Step(double progress) {
  if (!state_->splats.is_judged && progress >= kJudgedAt) Judge();
  SplatState& splats = state_->splats;
  const std::size_t view = fitted_[SplatTurn(fitted_.size(), state_->seed, splats.step)];
  const SplatTarget target = Target(view);
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

double SplatFit::FieldBeforeShare() const {
  SplatRasteriser rasteriser(workers_);
  double sum = 0, n = 0;
  for (std::size_t i = 0; i < fitted_.size(); i += 1 + (fitted_.size() - 1) / kViewsLookedAt) {
    const io::Frame& frame = scene_.frames[fitted_[i]];
    const io::Camera camera =
        SmallCamera(scene_.cameras[static_cast<std::size_t>(frame.camera_index)], kFitSide / 2);
    const io::Rigid3d& world_from_cam = world_from_cam_[fitted_[i]];
    const RayCamera ray_camera(camera, world_from_cam, scene_field_->field->pixel_offset());
    std::vector<CameraPixel> pixels;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) pixels.push_back({&ray_camera, x, y});
    }
    std::vector<float> median_depth;
    for (const RenderedRay& ray :
         RenderPixels(*scene_field_, pixels, 1, scene_field_->step_scale, workers_, {}, RayValues::kDepths))
      median_depth.push_back(ray.median_depth);
    for (const float value :
         FieldBeforeSplats(scene_field_->splats, camera, world_from_cam, median_depth, &rasteriser))
      sum += value;
    n += static_cast<double>(median_depth.size());
  }
  return sum / n;
}

std::string SplatFit::Finish() {
  SplatState& state = state_->splats;
  RequireFinite(scene_field_->splats);
  const double share = scene_field_->splat_share, before = FieldBeforeShare();
  scene_field_->splat_share_behind =
      static_cast<float>(std::clamp((kLeastHoles - before) / (kLeastHoles - kMostFloaters), 0.0, 1.0));
  state.moments = {};
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
  const SplatTarget target = Target(index);
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
