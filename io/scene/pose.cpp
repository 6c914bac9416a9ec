#include "io/scene/pose.h"

#include <Eigen/SVD>

namespace io {

// The only decomposition of its kind here: it takes the compiler half a minute.
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
  return u * Eigen::Vector3d(1, 1, (u * v.transpose()).determinant()).asDiagonal() * v.transpose();
}

}  // namespace io
