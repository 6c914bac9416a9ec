// Moves and scales a posed scene so that what the pictures show lies between near = 2 and far = 6 along every
// ray.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace sfm {

struct NormalizeReport {
  io::Scene scene;                      // in scene units; near, far, aabb, unbounded and scene_from_sfm set
  Eigen::Vector3d focus;                // in the units of the input: becomes the origin
  double f_over_n = 0;                  // ratio of the depth quantiles; 0 without points
  double depth_min = 0, depth_max = 0;  // n and f in scene units; 0 without points
  // Shares of the observations with near <= t <= far, and with t >= near. Nothing without points.
  std::optional<double> coverage, coverage_near;
  std::vector<std::string> decisions;
};

// Depth is t = |x - camera centre|, the distance along the ray, because near and far bound t. Over the
// observations of good points (track >= 3 and error <= 2 px where known; without tracks every frame whose
// picture contains the point),
//   n = min over frames of the 0.5 % quantile of t,  f = max over frames of the 99.5 % quantile.
// A similarity cannot change f / n, so:
//   * f / n <= 3: scale 8 / (n + f), hence 2 <= s n and s f <= 6; aabb = padded box of the points' quantiles.
//   * f / n > 3: scale such that the median camera stands 4 from the focus; [2, 6] and an aabb of half side 2
//   hold the
//     region of interest; `unbounded` is set, and the coverage says how many observations fall outside.
// The focus, which becomes the origin, is the point nearest to all optical axes (least squares), or the
// points' median when the axes are nearly parallel or meet behind the cameras. The mean up of the cameras
// becomes +z unless the cameras disagree. Only medians and quantiles are used: a few wild points or cameras
// change nothing.
//
// Throws kNotReconstructible for fewer than 3 frames, for cameras that all stand at one place, and when
// neither points nor axes tell how far away the scene is.
NormalizeReport NormalizeScene(const io::Scene& scene);

}  // namespace sfm
