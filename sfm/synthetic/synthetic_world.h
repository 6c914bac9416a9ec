// The geometry of a generated capture: cameras along a trajectory and the points they look at.
#pragma once

#include <vector>

#include "io/scene/pose.h"
#include "sfm/synthetic/capture_options.h"
#include "sfm/synthetic/random.h"

namespace sfm {

struct WorldPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // seen only from the side it points to; 0: from all
  int pattern = 0;  // points with the same pattern look alike; otherwise all differ
  // From the frame in which points of one pattern have the same surroundings.
  Eigen::Matrix3d world_from_pattern = Eigen::Matrix3d::Identity();
};

// Distance at which a ball of radius 1 fills four fifths of the picture's shorter side.
double ViewingDistance(const io::Camera& camera);

// options.duplicates + options.pictures poses, OpenGL axes, before options.scale and offset.
std::vector<io::Rigid3d> MakeTrajectory(const CaptureOptions& options, Random* random);

// options.points points (where patterns repeat, about as many), before options.scale and offset.
std::vector<WorldPoint> MakeStructure(const CaptureOptions& options, Random* random);

}  // namespace sfm
