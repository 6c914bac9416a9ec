#include "io/scene/decomposition.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace io {
namespace {

// Unit vectors whose sum is shorter count as opposite. That is off by at most this, and so would be the
// direction of a sum that short, by rounding.
constexpr double kOpposite = 1e-8;

}  // namespace

SymmetricEigen EigenDecomposition(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(matrix);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Eigen::Vector3d SolveSymmetric(const Eigen::Matrix3d& matrix, const Eigen::Vector3d& right) {
  return matrix.ldlt().solve(right);
}

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() > 0) return rotation;
  return svd.matrixU() * Eigen::Vector3d(1, 1, -1).asDiagonal() * svd.matrixV().transpose();
}

// Half a turn about `from`, then half a turn about the direction in the middle.
Eigen::Matrix3d RotationBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), sum = a + to.normalized();
  const Eigen::Vector3d middle = sum.norm() > kOpposite ? sum.normalized() : a.unitOrthogonal();
  const auto half_turn = [](const Eigen::Vector3d& axis) -> Eigen::Matrix3d {
    return 2 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
  };
  return half_turn(middle) * half_turn(a);
}

}  // namespace io
