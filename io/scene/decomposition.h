// Decompositions of 3x3 matrices. Each takes the compiler up to half a minute, hence one place for all.
#pragma once

#include <Eigen/Core>

namespace io {

struct SymmetricEigen {
  Eigen::Vector3d values;   // ascending
  Eigen::Matrix3d vectors;  // columns, orthonormal, in the order of the values
};

// Only the lower triangle of `matrix` is read.
SymmetricEigen EigenDecomposition(const Eigen::Matrix3d& matrix);

// x with matrix * x = right, for a symmetric matrix that is positive definite.
Eigen::Vector3d SolveSymmetric(const Eigen::Matrix3d& matrix, const Eigen::Vector3d& right);

// The rotation R that is nearest to `matrix`: R maximises trace(R^T matrix) (Kabsch 1976).
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

// The smallest rotation that turns `from` to the direction of `to`; about any axis across them when they are
// opposite.
Eigen::Matrix3d RotationBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace io
