// The spacing of points on a surface.
#include "nerf/splatting/point_spacing.h"

#include <gtest/gtest.h>

namespace nerf {
namespace {

TEST(PointSpacing, IsTheSideOfTheSquaresOfAGrid) {
  std::vector<Eigen::Vector3f> points;
  for (int x = 0; x < 40; ++x) {
    for (int y = 0; y < 40; ++y)
      points.emplace_back(0.1f * static_cast<float>(x), 0.1f * static_cast<float>(y), 7);
  }
  const std::vector<double> spacing = PointSpacing(points);
  // The eighth neighbour in the grid is a diagonal away; a circle that large has 6.3 squares, not 8.
  for (int x = 1; x < 39; ++x)
    for (int y = 1; y < 39; ++y) EXPECT_NEAR(spacing[static_cast<std::size_t>(40 * x + y)], 0.0886, 1e-3);
  EXPECT_GT(spacing[0], 0.12);  // in a corner
}

TEST(PointSpacing, FewPointsHaveFewerNeighbours) {
  EXPECT_TRUE(PointSpacing({}).empty());
  EXPECT_EQ(PointSpacing({Eigen::Vector3f::Zero()}), std::vector<double>{0});
  const std::vector<double> two = PointSpacing({{0, 0, 0}, {0, 0, 2}});
  EXPECT_NEAR(two[0], 2 * std::sqrt(M_PI), 1e-6);
  EXPECT_EQ(two[0], two[1]);
}

}  // namespace
}  // namespace nerf
