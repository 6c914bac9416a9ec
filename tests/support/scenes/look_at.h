// Support for tests: a camera pose by where it stands and what it looks at.
#pragma once

#include "io/scene/pose.h"

// OpenGL axes; `up` in the world points upwards in the picture.
inline io::Rigid3d LookAt(const Eigen::Vector3d& centre,
                          const Eigen::Vector3d& target,
                          const Eigen::Vector3d& up) {
  const Eigen::Vector3d back = (centre - target).normalized(), right = up.cross(back).normalized();
  io::Rigid3d pose;
  pose.rotation << right, back.cross(right), back;
  pose.translation = centre;
  return pose;
}
