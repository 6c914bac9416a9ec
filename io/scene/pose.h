// Rigid and similarity transforms in double precision, named target_from_source: x_in_b = b_from_a * x_in_a.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace io {

// x_in_target = rotation * x_in_source + translation, with rotation orthonormal and det = +1.
struct Rigid3d {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3d Inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return rotation * x_in_source + translation;
  }
};

inline Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return {c_from_b.rotation * b_from_a.rotation, c_from_b * b_from_a.translation};
}

// x_in_target = scale * rotation * x_in_source + translation, scale > 0.
struct Sim3d {
  double scale = 1.0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Sim3d Inverse() const {
    return {1.0 / scale, rotation.transpose(), -(rotation.transpose() * translation) / scale};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return scale * (rotation * x_in_source) + translation;
  }
};

inline Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return {c_from_b.scale * b_from_a.scale,
          c_from_b.rotation * b_from_a.rotation,
          c_from_b * b_from_a.translation};
}

// Moves a camera pose into another world: the centre is transformed, the camera keeps its own unit of length.
inline Rigid3d TransformPose(const Sim3d& b_from_a, const Rigid3d& a_from_cam) {
  return {b_from_a.rotation * a_from_cam.rotation, b_from_a * a_from_cam.translation};
}

// COLMAP's cameras look along +z with y down (OpenCV axes); `Scene` and transforms.json look along -z with y
// up (OpenGL axes). world_from_cam_gl = inverse(cam_cv_from_world) * diag(1, -1, -1).
inline Rigid3d FlipCameraAxes(const Rigid3d& world_from_cam) {
  const Eigen::Vector3d flip(1.0, -1.0, -1.0);
  return {world_from_cam.rotation * flip.asDiagonal(), world_from_cam.translation};
}

}  // namespace io
