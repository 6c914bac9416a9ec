// A box outside which nothing is shown.
#pragma once

#include "nerf/sampling/ray.h"

namespace nerf {

struct CropBox {
  io::Rigid3d world_from_box;                           // the box's centre and axes
  Eigen::Vector3d size = Eigen::Vector3d::Constant(2);  // lengths of its sides, scene units, > 0
};

bool Contains(const CropBox& box, const Eigen::Vector3d& point);

// Narrows the distances [*t_first, *t_last] of a ray to those inside the box; *t_first >= *t_last afterwards
// when none is left.
void Clip(const CropBox& box, const Ray& ray, float* t_first, float* t_last);

}  // namespace nerf
