// Pictures and masks whose pixels come from anywhere.
#include "io/image/resample.h"

#include <gtest/gtest.h>

namespace {

constexpr int kSide = 24;

// Every pixel from `shift` to the right of itself.
io::PixelSources Shifted(float shift) {
  io::PixelSources sources(kSide, kSide);
  for (int y = 0, i = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x, ++i) {
      sources.x[static_cast<std::size_t>(i)] = static_cast<float>(x) + 0.5f + shift;
      sources.y[static_cast<std::size_t>(i)] = static_cast<float>(y) + 0.5f;
    }
  }
  return sources;
}

io::Image Ramp(int channels) {
  io::Image image = io::MakeImage(kSide, kSide, channels);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      for (int c = 0; c < channels; ++c)
        image.Pixel(x, y)[c] = static_cast<std::uint8_t>(c == 3 ? 255 : 8 * x + 10 * c);
    }
  }
  return image;
}

TEST(Resample, PixelCentresLieAtHalves) {
  for (const int channels : {3, 4})
    EXPECT_EQ(io::Resample(Ramp(channels), Shifted(0)).data, Ramp(channels).data);
}

TEST(Resample, BetweenPixelsIsInterpolatedAndBeyondTheBorderIsTheBorder) {
  const io::Image image = io::Resample(Ramp(3), Shifted(0.5f));
  EXPECT_NEAR(image.Pixel(10, 5)[0], 84, 1);
  EXPECT_EQ(io::Resample(Ramp(3), Shifted(100)).Pixel(3, 3)[0], 8 * (kSide - 1));
}

TEST(Resample, TransparentPixelsHaveNoColour) {
  io::Image image = io::MakeImage(kSide, kSide, 4);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {  // red on the left; to the right of it transparent, and green
      image.Pixel(x, y)[x < 12 ? 0 : 1] = 200;
      image.Pixel(x, y)[3] = x < 12 ? 255 : 0;
    }
  }
  const io::Image moved = io::Resample(image, Shifted(0.5f));
  EXPECT_NEAR(moved.Pixel(11, 5)[3], 128, 2);
  EXPECT_NEAR(moved.Pixel(11, 5)[0], 200, 3);
  EXPECT_LE(moved.Pixel(11, 5)[1], 3);
}

TEST(Resample, OfAMaskTheNearestPixelCountsAndNothingBeyondIt) {
  io::Mask mask{kSide, kSide, std::vector<std::uint8_t>(kSide * kSide, 255)};
  mask.used[5 * kSide + 10] = 0;
  const io::Mask moved = io::Resample(mask, Shifted(2.2f));
  EXPECT_EQ(moved.used[5 * kSide + 8], 0);
  EXPECT_EQ(moved.used[5 * kSide + 9], 255);
  EXPECT_EQ(moved.used[5 * kSide + kSide - 1], 0);
}

}  // namespace
