// What the training cameras alone say about a capture: what they look at, how far away it is, what is up, and
// how far apart two views are.
#pragma once

#include <span>
#include <vector>

#include "io/scene/scene.h"

namespace nerf {

struct CaptureGeometry {
  Eigen::Vector3d focus = Eigen::Vector3d::Zero();  // nearest to the optical axes
  double hit_share = 0;    // of the cameras that have the focus in front of them, within their picture
  double axis_spread = 0;  // 1 - length of the mean optical axis: 0 for parallel axes, 1 for all around
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // mean of the cameras' places
  Eigen::Vector3d view = Eigen::Vector3d::Zero();    // mean optical axis, unit length
  double depth = 0;                                  // typical distance of what the pictures show
  double spacing = 0;  // median over cameras of the motion to the nearest other one
};

// Throws kBadInput for a scene without frames or with cameras in one place.
CaptureGeometry MeasureCapture(const io::Scene& scene);

// How far a picture moves between two poses, in radians: the angle between them, and the parallax of what is
// `depth` away.
double Motion(const io::Rigid3d& a, const io::Rigid3d& b, double depth);

// A pose between two: 0 is a, 1 is b; the shorter way round.
io::Rigid3d Between(const io::Rigid3d& a, const io::Rigid3d& b, double share);

// Weighted mean of places and of orientations. Weights are not negative, and one of them is positive;
// orientations must lie within a half turn of the heaviest one.
io::Rigid3d MeanPose(std::span<const io::Rigid3d> poses, std::span<const double> weights);

// A camera at `place` that looks at `target` with a level horizon.
io::Rigid3d LookAt(const Eigen::Vector3d& place, const Eigen::Vector3d& target, const Eigen::Vector3d& up);

// The poses of a scene's frames.
std::vector<io::Rigid3d> PosesOf(const io::Scene& scene);

// The longest of the cameras' focal lengths [px]: no picture has smaller pixels.
double LongestFocalLength(const io::Scene& scene);

}  // namespace nerf
