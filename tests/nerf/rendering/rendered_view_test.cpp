// Views with more pixels: what is even stays so, and edges of the surface are not mixed.
#include "nerf/rendering/rendered_view.h"

#include <gtest/gtest.h>

#include <limits>

namespace nerf {
namespace {

TEST(Magnified, KeepsRampsAndMixesNoMedianDepths) {
  constexpr int kWidth = 8, kHeight = 6, kTimes = 3;
  RenderedView view{.width = kWidth, .height = kHeight};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float u = static_cast<float>(x) + 0.5f, v = static_cast<float>(y) + 0.5f;
      view.rgb.insert(view.rgb.end(), {0.1f * u, 0.1f * v, 0.5f});
      view.depth.push_back(2 + u);
      view.opacity.push_back(0.125f * v);
      view.median_depth.push_back(x < 4 ? 3.f : std::numeric_limits<float>::infinity());
    }
  }
  const RenderedView large = Magnified(view, kTimes * kWidth, kTimes * kHeight);
  ASSERT_EQ(large.width, kTimes * kWidth);
  ASSERT_EQ(large.height, kTimes * kHeight);
  for (int y = 0; y < large.height; ++y) {
    for (int x = 0; x < large.width; ++x) {
      const auto i = static_cast<std::size_t>(y * large.width + x);
      EXPECT_EQ(large.median_depth[i], view.median_depth[static_cast<std::size_t>(x / kTimes)]);
      EXPECT_EQ(large.rgb[3 * i + 2], 0.5f);
      if (x < 2 || y < 2 || x >= large.width - 2 || y >= large.height - 2) continue;
      // Places in the large picture, in pixels of the small one.
      const float u = (static_cast<float>(x) + 0.5f) / kTimes, v = (static_cast<float>(y) + 0.5f) / kTimes;
      EXPECT_NEAR(large.rgb[3 * i], 0.1f * u, 1e-5);
      EXPECT_NEAR(large.rgb[3 * i + 1], 0.1f * v, 1e-5);
      EXPECT_NEAR(large.depth[i], 2 + u, 1e-5);
      EXPECT_NEAR(large.opacity[i], 0.125f * v, 1e-5);
    }
  }
}

}  // namespace
}  // namespace nerf
