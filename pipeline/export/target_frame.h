// The coordinates and the unit of length that exports are written in.
#pragma once

#include <string>

#include "io/scene/pose.h"

namespace pipeline {

// Two points of known distance, in the coordinates of the chosen frame.
struct PointsApart {
  Eigen::Vector3d a = Eigen::Vector3d::Zero(), b = Eigen::Vector3d::Zero();
  double metres = 0;
};

// From "x,y,z,x,y,z=METRES". Throws kUsage naming the option: other forms, one point twice, a distance that
// is not positive.
PointsApart ParsePointsApart(const std::string& option_name, const std::string& text);

struct FrameOptions {
  std::string frame = "scene";  // or "sfm", as the poses came
  std::string points_apart;     // as ParsePointsApart reads it; empty: the frame's own unit
};

struct TargetFrame {
  std::string name = "scene", unit = "scene unit";  // unit: for readers of the files
  io::Sim3d target_from_scene;
  bool IsScene() const { return name == "scene" && unit != "metre"; }
};

TargetFrame MakeTargetFrame(const FrameOptions& options, const io::Sim3d& scene_from_sfm);

}  // namespace pipeline
