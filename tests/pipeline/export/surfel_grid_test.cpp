// Thinning of points on a surface.
#include "pipeline/export/surfel_grid.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pipeline {
namespace {

using Eigen::Vector3d;

// Points on the unit sphere, evenly.
std::vector<Surfel> Sphere(int n) {
  std::vector<Surfel> surfels;
  for (int i = 0; i < n; ++i) {
    const double z = 1 - 2 * (i + 0.5) / n, r = std::sqrt(1 - z * z), a = 2.39996323 * i;
    const Vector3d place(r * std::cos(a), r * std::sin(a), z);
    surfels.push_back(
        {.position = place, .normal = place, .rgb = {0.5, z * z, 1}, .spacing = 1e-3, .support = 2});
  }
  return surfels;
}

TEST(SurfelGrid, KeepsAtMostAsManyAsWantedAndNotManyFewer) {
  for (const std::size_t most : {100u, 3000u}) {
    SurfelGrid grid(1e-3, most);
    for (const Surfel& surfel : Sphere(20000)) grid.Add(surfel, 1);
    const std::vector<Surfel> thinned = grid.Thinned();
    EXPECT_LE(thinned.size(), most);
    EXPECT_GT(thinned.size(), most / 2);
    for (const Surfel& surfel : thinned) {
      EXPECT_NEAR(surfel.position.norm(), 1, grid.cell() * grid.cell());
      EXPECT_GT(surfel.normal.dot(surfel.position.normalized()), 0.9);
      EXPECT_EQ(surfel.spacing, grid.cell());
    }
  }
}

TEST(SurfelGrid, TakesTheWeightedMeanOfACell) {
  SurfelGrid grid(1, 10);
  grid.Add({.position = {0.2, 0.5, 0.5}, .normal = {0, 0, 1}, .rgb = {0, 0, 0}, .spacing = 2, .support = 9},
           0.25);
  grid.Add(
      {.position = {0.7, 0.5, 0.5}, .normal = {0, 0.6, 0.8}, .rgb = {1, 1, 1}, .spacing = 4, .support = 3},
      0.0625);
  const std::vector<Surfel> thinned = grid.Thinned();
  ASSERT_EQ(thinned.size(), 1u);
  EXPECT_NEAR(thinned[0].position.x(), 0.3, 1e-12);
  EXPECT_NEAR(thinned[0].rgb.x(), 0.2, 1e-12);
  EXPECT_LT((thinned[0].normal - Vector3d(0, 0.12, 0.96).normalized()).norm(), 1e-12);
  EXPECT_EQ(thinned[0].spacing, 2);
  EXPECT_EQ(thinned[0].support, 9);
}

TEST(SurfelGrid, TheTwoFacesOfAThinThingStayApart) {
  SurfelGrid grid(1, 10);
  for (const double side : {1.0, -1.0})
    grid.Add({.position = {0.5, 0.5, 0.5 + 0.01 * side}, .normal = {0, 0, side}, .spacing = 0.1}, 1);
  const std::vector<Surfel> thinned = grid.Thinned();
  ASSERT_EQ(thinned.size(), 2u);
  EXPECT_NEAR(thinned[0].normal.z() + thinned[1].normal.z(), 0, 1e-12);
}

TEST(SurfelGrid, SurfacesThatMeetInACellKeepTheirNormals) {
  SurfelGrid grid(1, 10);
  for (const Vector3d& normal : {Vector3d(1, 0, 0), Vector3d(0, 0.1, 1), Vector3d(0, -0.1, 1)})
    grid.Add({.position = {0.5, 0.5, 0.5}, .normal = normal, .spacing = 0.1}, 1);
  const std::vector<Surfel> thinned = grid.Thinned();
  ASSERT_EQ(thinned.size(), 2u);
  EXPECT_EQ(thinned[0].normal, Vector3d(1, 0, 0));
  EXPECT_EQ(thinned[1].normal, Vector3d(0, 0, 1));
}

TEST(SurfelGrid, CellsBelowZeroAreAsLargeAsOthers) {
  SurfelGrid grid(1, 10);
  for (const double x : {-0.5, 0.5})
    grid.Add({.position = {x, 0.5, 0.5}, .normal = {0, 0, 1}, .spacing = 0.1}, 1);
  EXPECT_EQ(grid.Thinned().size(), 2u);
}

}  // namespace
}  // namespace pipeline
