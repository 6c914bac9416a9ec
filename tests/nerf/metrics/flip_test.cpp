// FLIP against values from the paper's formulas, computed apart from this code with dense two-dimensional
// filters.
#include "nerf/metrics/flip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "io/base/error.h"

namespace {

template <typename F>
io::Image Paint(int width, int height, F&& colour_at) {
  io::Image image = io::MakeImage(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::array<int, 3> colour = colour_at(x, y);
      for (std::size_t c = 0; c < 3; ++c) image.Pixel(x, y)[c] = static_cast<std::uint8_t>(colour[c]);
    }
  }
  return image;
}

io::Image Constant(const std::array<int, 3>& colour) {
  return Paint(32, 32, [&](int, int) { return colour; });
}

io::Image PatternA() {
  return Paint(64, 48, [](int x, int y) {
    return std::array<int, 3>{(x * 37 + y * 11) % 256, (x * x + 3 * y) % 256, (5 * x + y * y) % 256};
  });
}

io::Image PatternB() {
  return Paint(64, 48, [](int x, int y) {
    return std::array<int, 3>{(x * 37 + y * 11 + x / 8 * 3) % 256,
                              (x * x + 3 * y) % 256,
                              std::min(255, (5 * x + y * y) % 256 + 10)};
  });
}

io::Image Step(int at) {
  return Paint(64, 48, [&](int x, int) {
    const int v = x < at ? 40 : 200;
    return std::array<int, 3>{v, v, v};
  });
}

TEST(Flip, IdenticalPicturesDifferNowhere) {
  const nerf::FlipMap map = nerf::Flip(PatternA(), PatternA());
  EXPECT_EQ(map.mean, 0);
  EXPECT_EQ(*std::max_element(map.error.begin(), map.error.end()), 0);
}

TEST(Flip, ConstantColourPairs) {
  const auto error = [](const std::array<int, 3>& a, const std::array<int, 3>& b) {
    return nerf::Flip(Constant(a), Constant(b)).mean;
  };
  // Black to white: HyAB is 100, its power lies beyond the knee.
  EXPECT_NEAR(error({0, 0, 0}, {255, 255, 255}), 0.967379762, 1e-7);
  EXPECT_NEAR(error({255, 0, 0}, {0, 255, 0}), 0.986662275, 1e-7);
  EXPECT_NEAR(error({0, 255, 0}, {0, 0, 255}), 1, 1e-7);  // the largest distance of the gamut
  EXPECT_NEAR(error({128, 128, 128}, {130, 128, 128}), 0.040020664, 1e-7);
  EXPECT_NEAR(error({200, 100, 50}, {50, 100, 200}), 0.952225213, 1e-7);
}

TEST(Flip, PatternsWithFineDetail) {
  const nerf::FlipMap map = nerf::Flip(PatternA(), PatternB());
  EXPECT_NEAR(map.mean, 0.182217763, 1e-7);
  EXPECT_NEAR(map.error[0], 0.015564866, 1e-6);
  EXPECT_NEAR(map.error[20 * 64 + 30], 0.135631601, 1e-6);
  EXPECT_NEAR(*std::max_element(map.error.begin(), map.error.end()), 0.589204369, 1e-6);
}

TEST(Flip, MovedEdgeIsSeenWhereItMoved) {
  const nerf::FlipMap map = nerf::Flip(Step(32), Step(36));
  EXPECT_NEAR(map.mean, 0.101616235, 1e-7);
  EXPECT_NEAR(map.error[24 * 64 + 33], 0.965769375, 1e-6);
  EXPECT_LT(map.error[24 * 64 + 2], 1e-3);
}

TEST(Flip, IsSymmetric) {
  EXPECT_DOUBLE_EQ(nerf::Flip(PatternA(), PatternB()).mean, nerf::Flip(PatternB(), PatternA()).mean);
}

TEST(Flip, FineDetailVanishesWithDistance) {
  // One-pixel stripes: seen from twice as far they blur into the grey of the other picture.
  const io::Image stripes = Paint(64, 64, [](int x, int) {
    const int v = x % 2 ? 100 : 140;
    return std::array<int, 3>{v, v, v};
  });
  const io::Image shifted = Paint(64, 64, [](int x, int) {
    const int v = x % 2 ? 140 : 100;
    return std::array<int, 3>{v, v, v};
  });
  const double near = nerf::Flip(stripes, shifted, {.pixels_per_degree = 20}).mean;
  const double far = nerf::Flip(stripes, shifted, {.pixels_per_degree = 80}).mean;
  EXPECT_GT(near, 4 * far);
}

TEST(Flip, PicturesOfDifferentShapeAreRefused) {
  EXPECT_THROW(nerf::Flip(PatternA(), Constant({1, 2, 3})), io::Error);
}

}  // namespace
