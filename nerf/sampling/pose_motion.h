// Small motions of a camera, x = (c, w) in its own coordinates (OpenGL axes): position += R c, R <- R exp(w).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "io/scene/scene.h"

namespace nerf {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using PixelJacobian = Eigen::Matrix<double, 2, 6>;

inline io::Rigid3d MovedPose(const io::Rigid3d& world_from_cam, const Vector6d& motion) {
  const Eigen::Vector3d w = motion.tail<3>();
  io::Rigid3d moved = world_from_cam;
  moved.translation += world_from_cam.rotation * motion.head<3>();
  if (w.norm() > 0)
    moved.rotation = world_from_cam.rotation * Eigen::AngleAxisd(w.norm(), w.normalized()).matrix();
  return moved;
}

// The point at a distance along the ray through pixel coordinates (x, y) of a pinhole camera, in its
// coordinates.
inline Eigen::Vector3d PointInCamera(const io::Camera& camera, double x, double y, double distance) {
  const Eigen::Vector3d ray((x - camera.cx) / camera.fl_x, -(y - camera.cy) / camera.fl_y, -1);
  return ray.normalized() * distance;
}

// d pixel / d (c, w) of a point in camera coordinates.
inline PixelJacobian PixelOfMotion(const io::Camera& camera, const Eigen::Vector3d& x) {
  const double depth = -x.z();
  Eigen::Matrix<double, 2, 3> pixel_of_x;
  pixel_of_x << camera.fl_x / depth, 0, camera.fl_x * x.x() / (depth * depth),  //
      0, -camera.fl_y / depth, -camera.fl_y * x.y() / (depth * depth);
  Eigen::Matrix3d cross;  // x seen from the turned camera: exp(-w) x = x + x cross w
  cross << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
  Eigen::Matrix<double, 3, 6> x_of_motion;
  x_of_motion << -Eigen::Matrix3d::Identity(), cross;
  return pixel_of_x * x_of_motion;
}

}  // namespace nerf
