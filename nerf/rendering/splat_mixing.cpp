#include "nerf/rendering/splat_mixing.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace nerf {
namespace {

// Pictures of wide angles are not drawn larger than this, in sides of what is wanted.
constexpr double kMostShrink = 4;

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

}  // namespace

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

void MixSplats(const SceneField& scene_field,
               const io::Camera& camera,
               const io::Rigid3d& world_from_cam,
               const std::optional<CropBox>& crop,
               io::Workers* workers,
               RenderedView* view) {
  if (scene_field.splats.size() == 0) return;
  SplatRasteriser rasteriser(workers);
  SplatPicture picture = RenderSplats(scene_field, camera, world_from_cam, crop, &rasteriser);
  std::vector<float> blurred;  // what of `picture` the magnified view can tell; empty: all
  if (view->width != camera.width || view->height != camera.height) {
    const io::Camera small = io::ResizedCamera(camera, view->width, view->height);
    SplatPicture shrunk = Shrunk(picture, camera, small);
    PutBefore(view->rgb, &shrunk);
    blurred = Resized(shrunk.rgb, small, camera, 3, cv::INTER_LINEAR);
    *view = Magnified(*view, camera.width, camera.height);
  }
  PutBefore(view->rgb, &picture);
  for (std::size_t i = 0; i < view->rgb.size(); ++i) {
    const float opacity = crop ? view->opacity[i / 3] : 1, over = picture.rgb[i];
    const float detail = blurred.empty() ? 0 : opacity * (over - blurred[i]);
    view->rgb[i] = MixedValue(view->rgb[i] + detail, over, opacity * scene_field.splat_share);
  }
}

}  // namespace nerf
