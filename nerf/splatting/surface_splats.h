// Splats to begin with: discs that lie on a surface and fill it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "nerf/splatting/splats.h"

namespace nerf {

struct SurfacePoint {
  Eigen::Vector3f position, normal;  // scene coordinates; unit, outwards
  Eigen::Vector3f rgb;               // sRGB in [0, 1]
  float footprint;                   // of a pixel of the view that shows it, scene units
};

// One for each point, in an order in which neighbours in space are mostly neighbours in memory: pictures of
// them are then made from fewer lines of the caches. Throws io::Interrupted.
Splats SplatsOn(const std::vector<SurfacePoint>& points);

}  // namespace nerf
