// Bundle adjustment (Triggs et al., "Bundle adjustment - a modern synthesis", 2000): the poses, points and
// chosen camera parameters that minimise
//   1/2 sum over observations of rho(|| (ImgFromCam(x_cam) - xy) / sigma ||^2),
// rho Cauchy's loss (sfm/bundle/reprojection_cost.h).
#pragma once

#include <string>
#include <vector>

#include "io/scene/colmap_model.h"
#include "sfm/bundle/intrinsics.h"

namespace sfm {

struct AdjustmentOptions {
  std::vector<FreeIntrinsics> free;  // per camera of the scene
  // Per frame: the frame that it moves with, from the same place and turned against it as it is now: views of
  // one panorama. A frame that others move with names itself. Empty: each moves by itself.
  std::vector<std::size_t> moves_with;
  int max_iterations = 50;
  // Stops when a step lowers the cost by less than this share. At 1e-6, real captures have poses within 1e-4
  // degrees of the minimum; what still moves are points with contradicting observations.
  double function_tolerance = 1e-6;
  std::string title;  // of its progress; empty: none is shown
};

struct AdjustmentReport {
  double initial_cost = 0, final_cost = 0;
  int iterations = 0;
  bool converged = false;  // false: stopped by max_iterations
};

// The gauge is fixed during the solution: of the two frames farthest apart, the first keeps its pose, the
// second one coordinate of its centre. Frames and points without observations stay where they are.
//
// One thread, so that the same model gives the same bytes: on several, Ceres adds up the reduced camera
// system in the order in which the threads arrive (with two, poses changed by 1e-7 of the scene from run to
// run).
//
// Ends after the iteration in which an interrupt arrives, with io::Interrupted. Throws io::Error kNumeric,
// before anything is changed, naming the picture with an observation that is not finite or whose point does
// not lie in front of it; and when the solver finds no usable solution.
AdjustmentReport AdjustBundle(io::ColmapModel* model, const AdjustmentOptions& options);

}  // namespace sfm
