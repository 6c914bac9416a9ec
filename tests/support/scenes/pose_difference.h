// Support for tests: how far the poses of two models of the same pictures lie apart.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/scene/decomposition.h"
#include "io/scene/scene.h"

struct PoseDifference {
  double rotation_deg = 0;  // largest
  double centre = 0;        // largest, as a share of the extent of the centres
};

// What remains between two models of the same pictures after the best similarity (Umeyama, PAMI 1991).
inline PoseDifference Compare(const io::Scene& a, const io::Scene& b) {
  const auto n = static_cast<Eigen::Index>(a.frames.size());
  Eigen::Matrix3Xd from(3, n), to(3, n);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < n; ++i) {
    const io::Rigid3d &pose_a = a.frames[static_cast<std::size_t>(i)].world_from_cam,
                      &pose_b = b.frames[static_cast<std::size_t>(i)].world_from_cam;
    from.col(i) = pose_a.translation, to.col(i) = pose_b.translation;
    sum += pose_b.rotation * pose_a.rotation.transpose();
  }
  // Centred first: the offset of the world must not cost digits.
  const Eigen::Vector3d mean = to.rowwise().mean();
  to.colwise() -= mean;
  from.colwise() -= from.rowwise().mean().eval();
  const Eigen::Matrix3d covariance = to * from.transpose();
  const Eigen::Matrix3d turn = io::NearestRotation(covariance), b_from_a = io::NearestRotation(sum);
  const double scale = turn.cwiseProduct(covariance).sum() / from.squaredNorm();
  const double extent = to.colwise().norm().maxCoeff();
  PoseDifference worst;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d moved = scale * (turn * from.col(i));
    worst.centre = std::max(worst.centre, (moved - to.col(i)).norm() / extent);
    const Eigen::Matrix3d r = a.frames[static_cast<std::size_t>(i)].world_from_cam.rotation.transpose() *
                              b_from_a.transpose() *
                              b.frames[static_cast<std::size_t>(i)].world_from_cam.rotation;
    const Eigen::Vector3d axis(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
    const double angle = std::atan2(axis.norm(), r.trace() - 1);
    worst.rotation_deg = std::max(worst.rotation_deg, angle * 180 / std::numbers::pi);
  }
  return worst;
}
