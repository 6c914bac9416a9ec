// What camera refinement has done, for the record of a run.
#pragma once

#include <string>
#include <vector>

#include "io/scene/scene.h"
#include "nerf/steps/camera_refinement.h"

namespace nerf {

// A training view whose pose was refined.
struct MovedCamera {
  std::string name;
  double motion_px;  // of its picture, root mean square
  io::Rigid3d world_from_cam;
};

// In the order of the frames of `scene`, those that the refinement moves.
std::vector<MovedCamera> MovedCameras(const io::Scene& scene, const CameraRefinement& refinement);
// One line for the record of a run.
std::string Describe(const std::vector<MovedCamera>& moved, std::size_t n_views);

}  // namespace nerf
