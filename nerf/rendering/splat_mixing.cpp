#include "nerf/rendering/splat_mixing.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace nerf {
namespace {

// Pictures of wide angles are not drawn larger than this, in sides of what is wanted.
constexpr double kMostShrink = 4;

// Each pixel is the mean of what it covers.
std::vector<float> Shrunk(const std::vector<float>& values,
                          const io::Camera& from,
                          const io::Camera& to,
                          int channels) {
  std::vector<float> shrunk(static_cast<std::size_t>(to.width) *
                            static_cast<std::size_t>(to.height * channels));
  const cv::Mat large(from.height, from.width, CV_32FC(channels), const_cast<float*>(values.data()));
  cv::Mat small(to.height, to.width, CV_32FC(channels), shrunk.data());
  cv::resize(large, small, small.size(), 0, 0, cv::INTER_AREA);
  return shrunk;
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
  const SplatPicture picture = render(large);
  return {.rgb = Shrunk(picture.rgb, large, camera, 3),
          .transmittance = Shrunk(picture.transmittance, large, camera, 1)};
}

void MixSplats(const SceneField& scene_field,
               const io::Camera& camera,
               const io::Rigid3d& world_from_cam,
               const std::optional<CropBox>& crop,
               io::Workers* workers,
               RenderedView* view) {
  if (scene_field.splats.size() == 0) return;
  SplatRasteriser rasteriser(workers);
  const SplatPicture picture = RenderSplats(scene_field, camera, world_from_cam, crop, &rasteriser);
  for (std::size_t i = 0; i < view->rgb.size(); ++i) {
    const float share = scene_field.splat_share * (crop ? view->opacity[i / 3] : 1);
    view->rgb[i] = MixedValue(view->rgb[i], picture.rgb[i], picture.transmittance[i / 3], share);
  }
}

}  // namespace nerf
