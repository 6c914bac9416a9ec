#include "nerf/sampling/ray.h"

#include <cmath>

#include "io/base/error.h"

namespace nerf {

using io::Error;
using io::ExitCode;

RayCamera::RayCamera(const io::Camera& camera, const io::Rigid3d& world_from_cam, double pixel_offset) {
  if (camera.HasDistortion()) {
    throw Error(
        ExitCode::kBadInput, "camera has lens distortion", "Run `pipeline normalize`, which undistorts");
  }
  // One check here keeps NaN out of every ray, and so out of the grid's indices.
  if (!world_from_cam.rotation.allFinite() || !world_from_cam.translation.allFinite() ||
      !std::isfinite(camera.cx + camera.cy + 1.0 / camera.fl_x + 1.0 / camera.fl_y)) {
    throw Error(ExitCode::kBadInput, "a camera has a pose or intrinsics that are not finite");
  }
  inv_fl_x_ = static_cast<float>(1.0 / camera.fl_x);
  inv_fl_y_ = static_cast<float>(1.0 / camera.fl_y);
  cx_ = static_cast<float>(camera.cx - (pixel_offset - 0.5));
  cy_ = static_cast<float>(camera.cy - (pixel_offset - 0.5));
  for (int i = 0; i < 3; ++i) {
    origin_[i] = static_cast<float>(world_from_cam.translation[i]);
    for (int j = 0; j < 3; ++j) rotation_[3 * i + j] = static_cast<float>(world_from_cam.rotation(i, j));
  }
}

Ray RayCamera::RayThrough(int x, int y, float dx, float dy) const {
  const float u = (static_cast<float>(x) + 0.5f + dx - cx_) * inv_fl_x_,
              v = -(static_cast<float>(y) + 0.5f + dy - cy_) * inv_fl_y_;
  const float scale = 1.f / std::sqrt(u * u + v * v + 1.f);
  Ray ray;
  for (int i = 0; i < 3; ++i) {
    ray.origin[i] = origin_[i];
    ray.direction[i] = scale * (rotation_[3 * i] * u + rotation_[3 * i + 1] * v - rotation_[3 * i + 2]);
  }
  return ray;
}

PixelCell CellOfPixel(int index, int n_cells) {
  int columns = 1;
  while (columns * columns < n_cells) ++columns;
  return {index % columns, index / columns, 1.f / static_cast<float>(columns)};
}

}  // namespace nerf
