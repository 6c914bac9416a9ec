#include "nerf/data/sparse_depth.h"

#include <cmath>
#include <optional>

namespace nerf {
namespace {

std::optional<SparseDepth> DepthIn(const io::Scene& scene, std::size_t view, std::size_t point) {
  const io::Frame& frame = scene.frames[view];
  const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
  const Eigen::Vector3d in_cam = frame.world_from_cam.Inverse() * scene.points[point].xyz;
  const std::optional<Eigen::Vector2d> xy = io::ImgFromCam(camera, in_cam);
  if (!xy) return {};
  // Compared after rounding: a pixel is looked up with these values.
  const SparseDepth depth{.view = view,
                          .point = point,
                          .x = static_cast<float>(xy->x()),
                          .y = static_cast<float>(xy->y()),
                          .t = static_cast<float>(in_cam.norm())};
  const bool inside = depth.x >= 0 && depth.y >= 0 && depth.x < static_cast<float>(camera.width) &&
                      depth.y < static_cast<float>(camera.height);
  if (!inside || !(depth.t > 0) || !std::isfinite(depth.t)) return {};
  return depth;
}

}  // namespace

std::vector<SparseDepth> SparseDepths(const io::Scene& scene, const Dataset& dataset) {
  const std::vector<bool> used = dataset.UsedPixels();
  std::vector<SparseDepth> depths;
  for (std::size_t point = 0; point < scene.points.size(); ++point) {
    const std::vector<int>& observers = scene.points[point].frame_indices;
    if (observers.size() < kMinObservers) continue;
    for (const int frame : observers) {
      const std::optional<SparseDepth> depth = DepthIn(scene, static_cast<std::size_t>(frame), point);
      if (depth && (used.empty() || used[dataset.PixelOf(*depth)])) depths.push_back(*depth);
    }
  }
  return depths;
}

}  // namespace nerf
