#include "nerf/sampling/crop_box.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf {
namespace {

struct Range {
  float first, last;
};
Range Clipped(const CropBox& box, const Ray& ray, Range range) {
  Clip(box, ray, &range.first, &range.last);
  return range;
}

TEST(CropBox, KeepsThePartOfARayThatLiesInside) {
  CropBox box;
  box.world_from_box.translation = {0, 0, 5};
  box.size = {2, 4, 6};
  const Range whole = Clipped(box, {{0, 0, 0}, {0, 0, 1}}, {0, 100});
  EXPECT_FLOAT_EQ(whole.first, 2);
  EXPECT_FLOAT_EQ(whole.last, 8);
  const Range from_inside = Clipped(box, {{0.9f, 0, 5}, {-1, 0, 0}}, {0, 1.5f});
  EXPECT_FLOAT_EQ(from_inside.first, 0);
  EXPECT_FLOAT_EQ(from_inside.last, 1.5f);
  for (const Ray& misses :
       {Ray{{0, 0, 0}, {0, 0, -1}}, Ray{{1.1f, 0, 0}, {0, 0, 1}}, Ray{{0, 3, 5}, {1, 0, 0}}}) {
    const Range none = Clipped(box, misses, {0, 100});
    EXPECT_GE(none.first, none.last);
  }
}

TEST(CropBox, TurnsWithItsAxes) {
  CropBox box;
  box.world_from_box.rotation = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix();
  box.size = {2, 2, 20};
  const Eigen::Vector3d along = box.world_from_box.rotation.col(2);
  const Ray ray = {
      {0, 0, 0},
      {static_cast<float>(along.x()), static_cast<float>(along.y()), static_cast<float>(along.z())}};
  EXPECT_NEAR(Clipped(box, ray, {0, 100}).last, 10, 1e-4);
  EXPECT_NEAR(Clipped(box, {{0, 0, 0}, {0, 0, 1}}, {0, 100}).last, 1 / std::sin(0.3), 1e-4);
}

}  // namespace
}  // namespace nerf
