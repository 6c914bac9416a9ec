// Shares by place: between cells, at the faces of the cube, and at infinity.
#include "nerf/fields/share_map.h"

#include <gtest/gtest.h>

#include <limits>

namespace nerf {
namespace {

constexpr float kCellSide = 1.f / ShareMap::kResolution;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(ShareMap, IsLinearBetweenTheMiddlesOfCells) {
  ShareMap shares;
  EXPECT_TRUE(shares.empty());
  shares.cells.assign(ShareMap::kCells, 51);
  const UnitPlace middle = {10.5f * kCellSide, 20.5f * kCellSide, 30.5f * kCellSide};
  shares.cells[ShareMap::CellAt(middle)] = 255;
  EXPECT_NEAR(shares.At(middle), 1, 1e-5);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    UnitPlace place = middle;
    place[axis] += 0.25f * kCellSide;
    EXPECT_NEAR(shares.At(place), 0.2 + 0.75 * 0.8, 1e-4) << axis;
    place[axis] += 0.75f * kCellSide;
    EXPECT_NEAR(shares.At(place), 0.2, 1e-4) << axis;
  }
  const UnitPlace corner = {11 * kCellSide, 21 * kCellSide, 31 * kCellSide};
  EXPECT_NEAR(shares.At(corner), 0.2 + 0.8 / 8, 1e-4);
}

TEST(ShareMap, EndsWithItsOutermostCells) {
  ShareMap shares;
  shares.cells.assign(ShareMap::kCells, 0);
  shares.cells[0] = 102, shares.cells[ShareMap::kCells - 1] = 204;
  EXPECT_EQ(ShareMap::CellAt({0, 0, 0}), 0u);
  EXPECT_EQ(ShareMap::CellAt({1, 1, 1}), ShareMap::kCells - 1);
  EXPECT_NEAR(shares.At({0, 0, 0}), 0.4, 1e-5);
  EXPECT_NEAR(shares.At({1, 1, 1}), 0.8, 1e-5);
}

TEST(PlaceOfSurface, IsInTheContractionOrByDirectionAtInfinity) {
  const Ray ray{{1, 0, 0}, {0, 0, -1}};
  const SceneContraction bounded{.half = 2}, unbounded{.half = 2, .unbounded = true};
  EXPECT_EQ(PlaceOfSurface(bounded, ray, 1), (UnitPlace{0.75f, 0.5f, 0.25f}));
  EXPECT_EQ(PlaceOfSurface(unbounded, ray, 1), (UnitPlace{0.625f, 0.5f, 0.375f}));
  EXPECT_FALSE(PlaceOfSurface(bounded, ray, kInfinity));
  EXPECT_EQ(PlaceOfSurface(unbounded, ray, kInfinity), (UnitPlace{0.5f, 0.5f, 0}));
}

}  // namespace
}  // namespace nerf
