// sfm/scene/doming.h: a bent ground is measured as what it is, whatever the similarity and the plane.
#include "sfm/scene/doming.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "sfm/synthetic/random.h"

namespace {

using Eigen::Vector3d;

// Points of a disc of radius 1 around the origin with some relief, turned out of the axes.
std::vector<Vector3d> Ground(const Eigen::Matrix3d& turn) {
  sfm::Random random(3, 0);
  std::vector<Vector3d> points;
  for (int i = 0; i < 500; ++i) {
    const double r = std::sqrt(random.Uniform(0, 1)), angle = random.Uniform(0, 6.28318);
    points.push_back(turn * Vector3d(r * std::cos(angle), r * std::sin(angle), random.Uniform(-0.02, 0.02)));
  }
  return points;
}

TEST(Doming, IsTheBulgeOfTheRim) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  const std::vector<Vector3d> truth = Ground(turn);
  const Vector3d normal = turn.col(2);
  for (const double bulge : {0.0, 0.01, -0.03}) {
    std::vector<Vector3d> estimated;
    for (const Vector3d& p : truth) {
      const Vector3d bent = p + bulge * (p - p.dot(normal) * normal).squaredNorm() * normal;
      estimated.push_back(7 * turn * bent + Vector3d(5, -3, 2));
    }
    // The similarity is fitted to the bent points, and the extent is measured from their mean.
    EXPECT_NEAR(sfm::Doming(estimated, truth), std::abs(bulge), 0.05 * std::abs(bulge) + 1e-12);
  }
}

TEST(Doming, NeedsFourPointsOffALine) {
  const std::vector<Vector3d> three = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_TRUE(std::isnan(sfm::Doming(three, three)));
  const std::vector<Vector3d> line = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  EXPECT_TRUE(std::isnan(sfm::Doming(line, line)));
}

}  // namespace
