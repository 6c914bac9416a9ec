// Sharpness follows blur and not contrast.
#include "io/image/picture_measure.h"

#include <gtest/gtest.h>

#include <cstring>

namespace {

TEST(PictureMeasure, BlurLowersSharpnessAndContrastDoesNot) {
  io::Image sharp = io::MakeImage(320, 240, 3);
  std::uint32_t state = 1;
  for (int y = 0; y < sharp.height; ++y) {
    for (int x = 0; x < sharp.width; ++x) {
      if (x % 8 == 0) state = state * 1664525u + 1013904223u;
      const auto value = static_cast<std::uint8_t>(((y / 6 + x / 8) % 2 ? (state >> 24) / 2 : 0) + 40);
      std::memset(sharp.Pixel(x, y), value, 3);
    }
  }
  io::Image blurred = sharp, faint = sharp;
  for (int y = 0; y < sharp.height; ++y) {
    for (int x = 6; x < sharp.width - 6; ++x) {
      int sum = 0;
      for (int k = -6; k <= 6; ++k) sum += sharp.Pixel(x + k, y)[0];
      std::memset(blurred.Pixel(x, y), sum / 13, 3);  // motion along x only
    }
  }
  for (std::uint8_t& value : faint.data) value = static_cast<std::uint8_t>(100 + value / 2);
  EXPECT_LT(io::Sharpness(blurred), 0.4 * io::Sharpness(sharp));
  EXPECT_NEAR(io::Sharpness(faint), io::Sharpness(sharp), 0.1 * io::Sharpness(sharp));
}

}  // namespace
