// The shapes that a film's path can have; camera_path.h chooses among them.
#pragma once

#include <vector>

#include "nerf/paths/camera_path.h"

namespace nerf {

// A subject in the middle: azimuth, elevation and distance around the focus. The path moves in azimuth;
// elevation, distance and the point that is looked at are averages over the cameras near that azimuth,
// weighted by a Gaussian of the azimuth difference and, for an orbit, of the elevation's from the ring that
// has cameras on all sides. Sets kind (orbit or arc), poses and arc_deg.
void FitOrbit(const std::vector<io::Rigid3d>& cameras, int frames, CameraPath* path);

// An ellipse across the mean line of sight, within the spread of the cameras.
void FitSway(const std::vector<io::Rigid3d>& cameras, int frames, CameraPath* path);

// Along the cameras in the order given or, where that jumps to and fro, from neighbour to neighbour. What is
// still a jump is made along the cameras between. Smoothed, at even speed, slower at the ends.
void FitWalk(const std::vector<io::Rigid3d>& cameras, int frames, CameraPath* path);

}  // namespace nerf
