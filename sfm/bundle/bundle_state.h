// The parameters of bundle adjustment: a scene centred on its cameras, scaled to their spread and turned to
// the axes of the first one, so that the world it came in does not touch the numerics.
#pragma once

#include <vector>

#include "sfm/bundle/reprojection_cost.h"

namespace sfm {

struct BundleState {
  io::Sim3d unit_from_world;  // mean of the camera centres -> 0, their RMS distance from it -> 1
  std::vector<Eigen::Matrix3d> reference_rotations;  // cam_from_unit, OpenGL axes, per frame
  std::vector<PoseVector> poses;                     // relative to them
  std::vector<Eigen::Vector3d> points;
  std::vector<IntrinsicVector> intrinsics;  // per camera
};

// Poses start at rotation vector 0. Throws kNumeric naming the first picture whose pose is not finite, and
// when all cameras stand at one place.
BundleState ToBundleState(const io::Scene& scene);

// Each frame moves by itself (AdjustmentOptions::moves_with).
std::vector<std::size_t> MovingAlone(std::size_t n_frames);

// From the axes of the frame that `frame` moves with to its own, as the reference rotations have it; exactly
// the identity for a frame that moves by itself.
Eigen::Matrix3d RotationFromLeader(const BundleState& state, std::size_t leader, std::size_t frame);

// Writes poses, points and cameras back into the scene they came from.
void UpdateScene(const BundleState& state, io::Scene* scene);

}  // namespace sfm
