#include "nerf/rendering/hidden_points.h"

#include <algorithm>
#include <cmath>

#include "nerf/rendering/support_map.h"

namespace nerf {
namespace {

using Eigen::Vector3d;

bool SeenFromAlike(const io::Point3D& point, const Vector3d& centre, const io::Scene& train) {
  if (point.frame_indices.empty()) return true;
  const Vector3d direction = (point.xyz - centre).normalized();
  return std::any_of(point.frame_indices.begin(), point.frame_indices.end(), [&](int frame) {
    const Vector3d& from = train.frames[static_cast<std::size_t>(frame)].world_from_cam.translation;
    return (point.xyz - from).normalized().dot(direction) > std::cos(kLikeDirection);
  });
}

}  // namespace

std::optional<double> HiddenPointShare(const TrainedField& field,
                                       const io::Camera& camera,
                                       const io::Rigid3d& world_from_cam,
                                       const io::Scene& train,
                                       int threads) {
  const io::Camera small = SmallCamera(camera, SupportMap::kMaxSide);
  const RenderOptions options{
      .threads = threads, .step_scale = 1, .samples_per_pixel = 1, .depth_only = true};
  const RenderedView view = field.Render(small, world_from_cam, options);
  const io::Rigid3d cam_from_world = world_from_cam.Inverse();
  int n = 0, n_hidden = 0;
  for (const io::Point3D& point : train.points) {
    const auto xy = io::ImgFromCam(small, cam_from_world * point.xyz);
    if (!xy || !(xy->x() >= 0 && xy->x() < small.width && xy->y() >= 0 && xy->y() < small.height)) continue;
    if (!SeenFromAlike(point, world_from_cam.translation, train)) continue;
    const auto pixel = static_cast<std::size_t>(xy->y()) * static_cast<std::size_t>(small.width) +
                       static_cast<std::size_t>(xy->x());
    const double distance = (point.xyz - world_from_cam.translation).norm();
    n += 1;
    if (static_cast<double>(view.depth[pixel]) < (1 - kNearerShare) * distance) n_hidden += 1;
  }
  if (n < kFewestPoints) return std::nullopt;
  return static_cast<double>(n_hidden) / n;
}

}  // namespace nerf
