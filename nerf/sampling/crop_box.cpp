#include "nerf/sampling/crop_box.h"

#include <algorithm>
#include <cmath>

namespace nerf {

bool Contains(const CropBox& box, const Eigen::Vector3d& point) {
  const Eigen::Vector3d offset = box.world_from_box.Inverse() * point;
  return (offset.cwiseAbs().array() <= 0.5 * box.size.array()).all();
}

void Clip(const CropBox& box, const Ray& ray, float* t_first, float* t_last) {
  const io::Rigid3d box_from_world = box.world_from_box.Inverse();
  const Eigen::Vector3d origin =
      box_from_world * Eigen::Vector3d(ray.origin[0], ray.origin[1], ray.origin[2]);
  const Eigen::Vector3d direction =
      box_from_world.rotation * Eigen::Vector3d(ray.direction[0], ray.direction[1], ray.direction[2]);
  double first = *t_first, last = *t_last;
  for (int i = 0; i < 3; ++i) {
    const double half = 0.5 * box.size[i];
    if (direction[i] == 0) {
      if (std::abs(origin[i]) > half) last = first;
      continue;
    }
    const double a = (-half - origin[i]) / direction[i], b = (half - origin[i]) / direction[i];
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
  *t_first = static_cast<float>(first);
  *t_last = static_cast<float>(std::max(first, last));
}

}  // namespace nerf
