// Pictures of splats that can be worked out by hand.
#include "nerf/splatting/plain_rasteriser.h"

#include <gtest/gtest.h>

namespace nerf {
namespace {

// One pixel is one unit wide at distance 1; the middle of pixel (4, 3) is on the optical axis.
SplatView View() {
  SplatView view;
  view.camera = {.width = 9, .height = 7, .fl_x = 1, .fl_y = 1, .cx = 4.5, .cy = 3.5};
  return view;
}

// A round one at `place` of standard deviation sigma, red but for what degree 1 adds.
void Add(const Eigen::Vector3f& place, float sigma, float opacity, Splats* splats) {
  const std::size_t i = splats->size();
  splats->resize(i + 1);
  for (std::size_t c = 0; c < 3; ++c) {
    splats->places[3 * i + c] = place[static_cast<int>(c)];
    splats->log_scales[3 * i + c] = std::log(sigma);
    splats->colours[3 * kHarmonics * i + c] = static_cast<float>((c == 0 ? 0.5 : -0.5) / kHarmonic0);
  }
  splats->rotations[4 * i] = 2;
  splats->opacities[i] = std::log(opacity / (1 - opacity));
}

std::vector<double> Shown(const Splats& splats) { return RenderPlainly(splats, View(), {0, 0, 1}); }
std::size_t At(int x, int y) { return 3 * static_cast<std::size_t>(9 * y + x); }

TEST(PlainRasteriser, AWhiteBackgroundIsSeenThroughASplatByItsShape) {
  Splats splats;
  Add({0, 0, -1}, 1.2f, 0.8f, &splats);
  const std::vector<double> rgb = Shown(splats);
  for (const auto& [x, y] : {std::pair{4, 3}, {5, 3}, {4, 1}, {6, 4}}) {
    const double square = (x - 4) * (x - 4) + (y - 3) * (y - 3);
    const double alpha = 0.8 * std::exp(-square / (2 * (1.2 * 1.2 + kLowPass)));
    EXPECT_NEAR(rgb[At(x, y)], alpha, 1e-6) << x << " " << y;
    EXPECT_NEAR(rgb[At(x, y) + 1], 0, 1e-6);
    EXPECT_NEAR(rgb[At(x, y) + 2], 1 - alpha, 1e-6);
  }
}

TEST(PlainRasteriser, TheNearerSplatCoversTheOther) {
  Splats splats;
  Add({0, 0, -2}, 50, 0.9f, &splats);
  Add({0, 0, -1}, 50, 0.5f, &splats);
  splats.colours[0] = splats.colours[1], splats.colours[1] = splats.colours[3 * kHarmonics];  // far one green
  const std::vector<double> rgb = Shown(splats);
  EXPECT_NEAR(rgb[At(4, 3)], 0.5, 1e-6);
  EXPECT_NEAR(rgb[At(4, 3) + 1], 0.5 * 0.9, 1e-6);
  EXPECT_NEAR(rgb[At(4, 3) + 2], 0.5 * 0.1, 1e-6);
}

TEST(PlainRasteriser, ColoursOfDegreeOneFollowTheDirection) {
  Splats splats;
  Add({0, 0, -1}, 50, 0.9f, &splats);
  splats.colours[3 * 2] = 0.3f;  // times the direction's z, which is -1
  EXPECT_NEAR(Shown(splats)[At(4, 3)], 0.9 * (1 - 0.3 * kHarmonic1), 1e-6);
  splats.colours[3 * 2] = 9;  // never below 0
  EXPECT_EQ(Shown(splats)[At(4, 3)], 0);
}

TEST(PlainRasteriser, ALongSplatLiesAsItsQuaternionTurnsIt) {
  Splats splats;
  Add({0, 0, -1}, 0.01f, 0.9f, &splats);
  splats.log_scales[0] = std::log(2.f);
  // About the camera's z by 90 degrees: from x to y.
  splats.rotations = {1, 0, 0, 1};
  const std::vector<double> rgb = Shown(splats);
  EXPECT_NEAR(rgb[At(4, 1)], 0.9 * std::exp(-2 / (4 + kLowPass)), 1e-4);
  EXPECT_LT(rgb[At(6, 3)], 0.01);
}

}  // namespace
}  // namespace nerf
