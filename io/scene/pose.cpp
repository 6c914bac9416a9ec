#include "io/scene/pose.h"

namespace io {

Rigid3d Rigid3d::Inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }

Eigen::Vector3d Rigid3d::operator*(const Eigen::Vector3d& x_in_source) const {
  return rotation * x_in_source + translation;
}

Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return {c_from_b.rotation * b_from_a.rotation, c_from_b * b_from_a.translation};
}

Sim3d Sim3d::Inverse() const {
  return {1.0 / scale, rotation.transpose(), -(rotation.transpose() * translation) / scale};
}

Eigen::Vector3d Sim3d::operator*(const Eigen::Vector3d& x_in_source) const {
  return scale * (rotation * x_in_source) + translation;
}

Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return {c_from_b.scale * b_from_a.scale,
          c_from_b.rotation * b_from_a.rotation,
          c_from_b * b_from_a.translation};
}

Rigid3d TransformPose(const Sim3d& b_from_a, const Rigid3d& a_from_cam) {
  return {b_from_a.rotation * a_from_cam.rotation, b_from_a * a_from_cam.translation};
}

Rigid3d FlipCameraAxes(const Rigid3d& world_from_cam) {
  const Eigen::Vector3d flip(1.0, -1.0, -1.0);
  return {world_from_cam.rotation * flip.asDiagonal(), world_from_cam.translation};
}

}  // namespace io
