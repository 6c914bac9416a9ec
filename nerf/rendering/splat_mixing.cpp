#include "nerf/rendering/splat_mixing.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace nerf {
namespace {

// Pictures of wide angles are not drawn larger than this, in sides of what is wanted.
constexpr double kMostShrink = 4;
constexpr float kTransparent = 1e-3f;  // opacity of splats below which they have no distance

std::vector<float> Resized(
    const std::vector<float>& values, const io::Camera& from, const io::Camera& to, int channels, int how) {
  std::vector<float> resized(static_cast<std::size_t>(to.width) *
                             static_cast<std::size_t>(to.height * channels));
  const cv::Mat before(from.height, from.width, CV_32FC(channels), const_cast<float*>(values.data()));
  cv::Mat after(to.height, to.width, CV_32FC(channels), resized.data());
  cv::resize(before, after, after.size(), 0, 0, how);
  return resized;
}

// Each pixel is the mean of what it covers.
SplatPicture Shrunk(const SplatPicture& picture, const io::Camera& from, const io::Camera& to) {
  return {.rgb = Resized(picture.rgb, from, to, 3, cv::INTER_AREA),
          .transmittance = Resized(picture.transmittance, from, to, 1, cv::INTER_AREA)};
}

// Puts the splats, which are before black, before the field's picture of the same size.
void PutBefore(const std::vector<float>& field_rgb, SplatPicture* splats) {
  for (std::size_t i = 0; i < field_rgb.size(); ++i)
    splats->rgb[i] += splats->transmittance[i / 3] * field_rgb[i];
}

Splats SplatsIn(const Splats& splats, const CropBox& box) {
  return SplatsWhere(splats, [&](const Eigen::Vector3d& middle) { return Contains(box, middle); });
}

// The splats' opacity over their distance, in the first channel; a fine structure is not needed.
SplatPicture InverseDistances(Splats splats,
                              const io::Camera& camera,
                              const io::Rigid3d& world_from_cam,
                              SplatRasteriser* rasteriser) {
  std::ranges::fill(splats.colours, 0.f);
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const Eigen::Vector3d middle = Eigen::Vector3f(&splats.places[3 * i]).cast<double>();
    const double distance = std::max(kNearestSplat, (middle - world_from_cam.translation).norm());
    splats.colours[3 * kHarmonics * i] = static_cast<float>((1 / distance - 0.5) / kHarmonic0);
  }
  return rasteriser->Render(splats, {camera, world_from_cam});
}

// The splats' share of each pixel of the field's view.
std::vector<float> SplatShares(const SceneField& scene_field,
                               const io::Camera& camera,
                               const io::Rigid3d& world_from_cam,
                               const std::optional<CropBox>& crop,
                               const RenderedView& view,
                               SplatRasteriser* rasteriser) {
  const float behind = scene_field.splat_share_behind;
  std::vector<float> shares(view.rgb.size() / 3, scene_field.splat_share);
  if (view.median_depth.empty()) return shares;
  const io::Camera seen_by = io::ResizedCamera(camera, view.width, view.height);
  if (!scene_field.splat_shares.empty()) {
    const RayCamera ray_camera(seen_by, world_from_cam, scene_field.field->pixel_offset());
    for (std::size_t i = 0; i < shares.size(); ++i) {
      const int at = static_cast<int>(i);
      shares[i] = SplatShareAt(
          scene_field, ray_camera.RayThrough(at % view.width, at / view.width), view.median_depth[i]);
    }
  }
  if (behind <= *std::ranges::min_element(shares)) return shares;
  const std::vector<float> before =
      FieldBeforeSplats(crop ? SplatsIn(scene_field.splats, *crop) : scene_field.splats,
                        seen_by,
                        world_from_cam,
                        view.median_depth,
                        rasteriser);
  for (std::size_t i = 0; i < shares.size(); ++i) shares[i] += std::max(0.f, behind - shares[i]) * before[i];
  return shares;
}

}  // namespace

float SplatShareAt(const SceneField& scene_field, const Ray& ray, float median_depth) {
  if (scene_field.splat_shares.empty()) return scene_field.splat_share;
  const auto place = PlaceOfSurface(scene_field.contraction, ray, median_depth);
  return place ? scene_field.splat_shares.At(*place) : scene_field.splat_share;
}

SplatView SplatViewOf(const SceneField& scene_field,
                      const io::Camera& camera,
                      const io::Rigid3d& world_from_cam) {
  const double zoom = camera.fl_x / static_cast<double>(scene_field.splat_focal_px);
  return {camera, world_from_cam, zoom * zoom * kLowPass};
}

SplatPicture RenderSplats(const SceneField& scene_field,
                          const io::Camera& camera,
                          const io::Rigid3d& world_from_cam,
                          const std::optional<CropBox>& crop,
                          SplatRasteriser* rasteriser) {
  const Splats inside = crop ? SplatsIn(scene_field.splats, *crop) : Splats{};
  const Splats& shown = crop ? inside : scene_field.splats;
  const auto render = [&](const io::Camera& seen_by) {
    return rasteriser->Render(shown, SplatViewOf(scene_field, seen_by, world_from_cam));
  };
  const double zoom = camera.fl_x / static_cast<double>(scene_field.splat_focal_px);
  if (zoom >= kLeastZoom) return render(camera);
  const double times = std::min(kMostShrink, 1 / zoom);
  const io::Camera large = io::ResizedCamera(camera,
                                             static_cast<int>(std::ceil(times * camera.width)),
                                             static_cast<int>(std::ceil(times * camera.height)));
  return Shrunk(render(large), large, camera);
}

std::vector<float> FieldBeforeSplats(Splats splats,
                                     const io::Camera& camera,
                                     const io::Rigid3d& world_from_cam,
                                     const std::vector<float>& median_depth,
                                     SplatRasteriser* rasteriser) {
  const SplatPicture inverse = InverseDistances(std::move(splats), camera, world_from_cam, rasteriser);
  std::vector<float> before(median_depth.size(), 0.f);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const float opacity = 1 - inverse.transmittance[i];
    if (opacity < kTransparent || !std::isfinite(median_depth[i])) continue;
    const float nearer = median_depth[i] * inverse.rgb[3 * i] / opacity;
    before[i] = std::clamp((kNearlyAsFar - nearer) / (kNearlyAsFar - kWellBefore), 0.f, 1.f);
  }
  return before;
}

void MixSplats(const SceneField& scene_field,
               const io::Camera& camera,
               const io::Rigid3d& world_from_cam,
               const std::optional<CropBox>& crop,
               io::Workers* workers,
               RenderedView* view) {
  if (scene_field.splats.size() == 0) return;
  SplatRasteriser rasteriser(workers);
  SplatPicture picture = RenderSplats(scene_field, camera, world_from_cam, crop, &rasteriser);
  std::vector<float> shares = SplatShares(scene_field, camera, world_from_cam, crop, *view, &rasteriser);
  std::vector<float> blurred;  // what of `picture` the magnified view can tell; empty: all
  if (view->width != camera.width || view->height != camera.height) {
    const io::Camera small = io::ResizedCamera(camera, view->width, view->height);
    SplatPicture shrunk = Shrunk(picture, camera, small);
    PutBefore(view->rgb, &shrunk);
    blurred = Resized(shrunk.rgb, small, camera, 3, cv::INTER_LINEAR);
    shares = Resized(shares, small, camera, 1, cv::INTER_LINEAR);
    *view = Magnified(*view, camera.width, camera.height);
  }
  PutBefore(view->rgb, &picture);
  for (std::size_t i = 0; i < view->rgb.size(); ++i) {
    const float opacity = crop ? view->opacity[i / 3] : 1, over = picture.rgb[i];
    const float detail = blurred.empty() ? 0 : opacity * (over - blurred[i]);
    view->rgb[i] = MixedValue(view->rgb[i] + detail, over, opacity * shares[i / 3]);
  }
}

}  // namespace nerf
