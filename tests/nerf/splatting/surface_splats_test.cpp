// Splats on a surface fill it, lie in it, and have its colour.
#include "nerf/splatting/surface_splats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "nerf/splatting/plain_rasteriser.h"

namespace nerf {
namespace {

// A square of side 2 in the plane z = -3, seen from the origin along -z.
std::vector<SurfacePoint> Square(int per_side) {
  std::vector<SurfacePoint> points;
  const auto place = [&](int i) {
    return 2 * (static_cast<float>(i) + 0.5f) / static_cast<float>(per_side) - 1;
  };
  for (int x = 0; x < per_side; ++x) {
    for (int y = 0; y < per_side; ++y)
      points.push_back({{place(x), place(y), -3}, {0, 0, 1}, {0.25f, 0.5f, 0.75f}, 0.05f});
  }
  return points;
}

TEST(SurfaceSplats, FillASurfaceWithItsColour) {
  const Splats splats = SplatsOn(Square(30));
  ASSERT_EQ(splats.size(), 900u);
  SplatView view;
  view.camera = {.width = 20, .height = 20, .fl_x = 60, .fl_y = 60, .cx = 10, .cy = 10};  // the inner half
  const std::vector<double> black = RenderPlainly(splats, view, {0, 0, 0}),
                            white = RenderPlainly(splats, view, {1, 1, 1});
  double least = 1, most = 0;  // of the light that passes
  for (std::size_t i = 0; i < black.size(); ++i) {
    const double passes = white[i] - black[i];
    EXPECT_NEAR(black[i], 0.25 * static_cast<double>(i % 3 + 1) * (1 - passes), 0.003);
    least = std::min(least, passes), most = std::max(most, passes);
  }
  EXPECT_LT(most, 0.21) << "no holes";
  EXPECT_GT(least, 0.18) << "evenly";
}

TEST(SurfaceSplats, AreFlatAcrossTheNormal) {
  std::vector<SurfacePoint> points = Square(3);
  for (SurfacePoint& point : points) point.normal = Eigen::Vector3f(1, 2, -2) / 3;
  const Splats splats = SplatsOn(points);
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const float* q = &splats.rotations[4 * i];
    const Eigen::Vector3f thin = Eigen::Quaternionf(q[0], q[1], q[2], q[3]) * Eigen::Vector3f::UnitZ();
    EXPECT_LT((thin - points[i].normal).norm(), 1e-5);
    EXPECT_NEAR(splats.log_scales[3 * i + 2], splats.log_scales[3 * i] + std::log(0.1f), 1e-5);
  }
}

// In units of the footprint, 0.05.
TEST(SurfaceSplats, NeitherVanishNorSwell) {
  const SurfacePoint point = Square(1)[0];
  SurfacePoint far = point;
  far.position.x() += 100;
  EXPECT_NEAR(std::exp(SplatsOn({point, point}).log_scales[0]), 0.6 * 0.3 * 0.05, 1e-6);
  EXPECT_NEAR(std::exp(SplatsOn({point, far}).log_scales[0]), 0.6 * 10 * 0.05, 1e-5);
  EXPECT_EQ(SplatsOn({}).size(), 0u);
}

}  // namespace
}  // namespace nerf
