// The path of the film's camera: an orbit fitted to where the photographs were taken, so that the film shows
// what was observed.
//
// Camera centres are written as azimuth, elevation and distance around the focus point (the point nearest to
// all optical axes) and the up direction (perpendicular to the cameras' horizontal axes). The path moves in
// azimuth; elevation and distance are averages over the cameras near that azimuth, weighted by a Gaussian of
// the azimuth difference, hence never outside the observed range. Cameras all around give a closed orbit;
// cameras along an arc give a flat ellipse that swings to and fro inside the arc.
#pragma once

#include <vector>

#include "io/scene/scene.h"

namespace nerf {

struct CameraPath {
  std::vector<io::Rigid3d> world_from_cam;  // OpenGL axes, looking at the focus; the last precedes the first
  bool closed = false;                      // a full orbit, or else a swing inside the covered arc
  double arc_deg = 0;                       // azimuth that the cameras cover
  Eigen::Vector3d focus = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double distance = 0;  // mean over the path, in scene units
};

// Throws kBadInput for a scene without frames or with cameras in one place.
CameraPath FitOrbit(const io::Scene& scene, int frames);

}  // namespace nerf
