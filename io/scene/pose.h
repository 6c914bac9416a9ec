// Rigid and similarity transforms in double precision, named target_from_source: x_in_b = b_from_a * x_in_a.
// Their functions stand apart: in each file that includes this, Eigen's templates cost the compiler half a
// second.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace io {

// x_in_target = rotation * x_in_source + translation, with rotation orthonormal and det = +1.
struct Rigid3d {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3d Inverse() const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const;
};
Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a);

// x_in_target = scale * rotation * x_in_source + translation, scale > 0.
struct Sim3d {
  double scale = 1.0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Sim3d Inverse() const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const;
};
Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a);

// Moves a camera pose into another world: the centre is transformed, the camera keeps its own unit of length.
Rigid3d TransformPose(const Sim3d& b_from_a, const Rigid3d& a_from_cam);

// COLMAP's cameras look along +z with y down (OpenCV axes); `Scene` and transforms.json look along -z with y
// up (OpenGL axes). world_from_cam_gl = inverse(cam_cv_from_world) * diag(1, -1, -1).
Rigid3d FlipCameraAxes(const Rigid3d& world_from_cam);

}  // namespace io
