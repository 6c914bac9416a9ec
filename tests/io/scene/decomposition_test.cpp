// io/scene/decomposition.h
#include "io/scene/decomposition.h"

#include <gtest/gtest.h>

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kExact = 1e-12;

void ExpectRotation(const Matrix3d& r) {
  EXPECT_LT((r * r.transpose() - Matrix3d::Identity()).norm(), kExact);
  EXPECT_NEAR(r.determinant(), 1, kExact);
}

Matrix3d SomeSymmetric() {
  Matrix3d matrix;
  matrix << 4, 1, -2, 1, 3, 0.5, -2, 0.5, 5;
  return matrix;
}

TEST(Decomposition, EigenvaluesAscendAndGiveTheMatrixBack) {
  const auto [values, vectors] = io::EigenDecomposition(SomeSymmetric());
  EXPECT_LT(values[0], values[1]);
  EXPECT_LT(values[1], values[2]);
  EXPECT_LT((vectors * values.asDiagonal() * vectors.transpose() - SomeSymmetric()).norm(), kExact);
  EXPECT_LT((vectors.transpose() * vectors - Matrix3d::Identity()).norm(), kExact);
}

TEST(Decomposition, SymmetricSystemsAreSolved) {
  const Vector3d x(1, -2, 3);
  EXPECT_LT((io::SolveSymmetric(SomeSymmetric(), SomeSymmetric() * x) - x).norm(), kExact);
}

TEST(Decomposition, TheNearestRotationIgnoresStretchAndNeverMirrors) {
  const Matrix3d rotation = io::RotationBetween({1, 2, 3}, {-2, 1, 0.5});
  EXPECT_LT((io::NearestRotation(rotation * SomeSymmetric()) - rotation).norm(), kExact);
  ExpectRotation(io::NearestRotation(Vector3d(1, 1, -1).asDiagonal()));
}

TEST(Decomposition, ARotationTurnsOneDirectionToAnother) {
  const Vector3d from(0.3, -2, 1);
  const Vector3d across = from.cross(Vector3d::UnitX()), nearly = -from + 1e-8 * across,
                 hardly = -from + 1e-7 * across;
  for (const Vector3d& to : {Vector3d(0, 0, 1), Vector3d(5, 1, 0), from, Vector3d(-from), nearly, hardly}) {
    const Matrix3d rotation = io::RotationBetween(from, to);
    ExpectRotation(rotation);
    EXPECT_LT((rotation * from.normalized() - to.normalized()).norm(), 1e-7);
  }
}

TEST(Decomposition, TheRotationBetweenTwoDirectionsIsTheSmallest) {
  const Vector3d from(0.3, -2, 1), to(5, 1, 0), axis = from.cross(to);
  EXPECT_LT((io::RotationBetween(from, to) * axis - axis).norm(), kExact * axis.norm());
}

}  // namespace
