// Backgrounds of one colour: when there is one, and what alpha it gives.
#include "nerf/data/plain_background.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <numeric>

namespace nerf {
namespace {

constexpr int kWidth = 24, kHeight = 20;

// Two views of a grey ring with a hole, on a colour with the noise of JPEG. The ring may have a gap in one
// direction.
struct RingViews {
  explicit RingViews(int noise = 2, int gap_x = 0, int gap_y = 0) {
    const io::Camera camera{.width = kWidth, .height = kHeight, .fl_x = 20, .fl_y = 20, .cx = 12, .cy = 10};
    for (std::size_t v = 0; v < 2; ++v) {
      dataset.views.push_back(
          {"view", RayCamera(camera, io::Rigid3d()), kWidth, kHeight, v * kWidth * kHeight});
      for (int p = 0; p < kWidth * kHeight; ++p) {
        const int x = p % kWidth - 12, y = p / kWidth - 10, r2 = x * x + y * y;
        const bool in_gap = x * gap_x + y * gap_y > 0 && std::abs(x * gap_y) + std::abs(y * gap_x) == 0;
        const bool on_ring = r2 >= 9 && r2 <= 49 && !in_gap;
        for (const int level : {240, 30, 128})
          dataset.pixels.push_back(static_cast<std::uint8_t>(on_ring ? 90 : level + p % (noise + 1)));
      }
    }
  }
  int AlphaAt(int x, int y) const {
    return dataset.pixels[4 * static_cast<std::size_t>((y + 10) * kWidth + x + 12) + 3];
  }
  Dataset dataset;
};

TEST(PlainBackground, IsTheColourOfTheBordersAndWhatIsJoinedToThem) {
  RingViews views;
  const std::vector<std::uint8_t> rgb = views.dataset.pixels;
  MarkPlainBackground(&views.dataset);
  ASSERT_TRUE(views.dataset.background);
  const float want[] = {241 / 255.f, 31 / 255.f, 129 / 255.f};
  for (std::size_t j = 0; j < 3; ++j) EXPECT_EQ((*views.dataset.background)[j], want[j]);
  ASSERT_EQ(views.dataset.channels, 4);
  for (std::size_t p = 0; p < rgb.size() / 3; ++p) {
    for (std::size_t j = 0; j < 3; ++j) ASSERT_EQ(views.dataset.pixels[4 * p + j], rgb[3 * p + j]);
  }
  EXPECT_EQ(views.AlphaAt(-12, -10), 0);
  EXPECT_EQ(views.AlphaAt(8, 0), 0);
  EXPECT_EQ(views.AlphaAt(7, 0), 128) << "the edge, which may have background in it";
  EXPECT_EQ(views.AlphaAt(5, 0), 255);
  EXPECT_EQ(views.AlphaAt(0, 0), 128) << "the hole may be a part of the object in this colour";
}

TEST(PlainBackground, TakesHalfOfTheBordersToTell) {
  // 168 pixels lie on the borders of both views. A cut-out subject that touches them shows no background.
  for (const std::size_t n_used : {83u, 84u}) {
    RingViews views;
    std::vector<bool> used(views.dataset.n_pixels(), true);
    std::size_t n_border = 0;
    for (std::size_t p = 0; p < used.size(); ++p) {
      const std::size_t x = p % kWidth, y = p / kWidth % kHeight;
      const bool is_border = x == 0 || y == 0 || x == kWidth - 1 || y == kHeight - 1;
      used[p] = !is_border || n_border < n_used;
      n_border += is_border;
    }
    ASSERT_EQ(n_border, 168u);
    views.dataset.Use(used);
    MarkPlainBackground(&views.dataset);
    EXPECT_EQ(views.dataset.background.has_value(), n_used == 84);
  }
}

TEST(PlainBackground, ComesInThroughAGapFromAnySide) {
  const int gaps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  for (const auto& [x, y] : gaps) {
    RingViews views(2, x, y);
    MarkPlainBackground(&views.dataset);
    EXPECT_EQ(views.AlphaAt(5 * x, 5 * y), 0) << x << " " << y;
    EXPECT_EQ(views.AlphaAt(0, 0), 0) << x << " " << y;
    EXPECT_EQ(views.AlphaAt(-5 * x, -5 * y), 255) << x << " " << y;
  }
}

// 168 pixels are on the borders of both views; 2 % of them may have another colour.
TEST(PlainBackground, FewOddBorderPixelsDoNotMatterManyDo) {
  for (const int n_odd : {3, 4}) {
    RingViews views;
    for (std::size_t p = 0; p < static_cast<std::size_t>(n_odd); ++p) views.dataset.pixels[3 * p] = 0;
    MarkPlainBackground(&views.dataset);
    EXPECT_EQ(views.dataset.background.has_value(), n_odd == 3);
  }
}

TEST(PlainBackground, OtherPicturesStayAsTheyAre) {
  RingViews noisy(6), transparent;
  transparent.dataset.channels = 4;
  transparent.dataset.pixels.resize(transparent.dataset.pixels.size() / 3 * 4);
  for (Dataset* dataset : {&noisy.dataset, &transparent.dataset}) {
    const Dataset before = *dataset;
    MarkPlainBackground(dataset);
    EXPECT_FALSE(dataset->background);
    EXPECT_EQ(dataset->channels, before.channels);
    EXPECT_EQ(dataset->pixels, before.pixels);
  }
}

TEST(PlainBackground, PixelsThatAreNotUsedSayNothing) {
  RingViews views;
  for (std::size_t p = 0; p < kWidth; ++p) views.dataset.pixels[3 * p] = 0;  // the first row
  // Nor those of the second, which have the colour.
  views.dataset.runs =
      PixelRuns({{0, 2 * kWidth}, {2 * kWidth * kHeight - 2 * kWidth, 2 * kWidth * kHeight}});
  MarkPlainBackground(&views.dataset);
  EXPECT_TRUE(views.dataset.background);
  EXPECT_EQ(views.AlphaAt(0, -9), 128);
  EXPECT_EQ(views.AlphaAt(0, -8), 0);
}

}  // namespace
}  // namespace nerf
