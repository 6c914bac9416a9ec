// PSNR and SSIM against closed forms, an independent dense implementation and their documented errors.
#include "nerf/metrics/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "io/base/error.h"
#include "nerf/metrics/flip.h"
#include "tests/support/files/temp_dir.h"

namespace {

io::Image Constant(int width, int height, std::uint8_t value) {
  io::Image image = io::MakeImage(width, height, 3);
  for (std::uint8_t& v : image.data) v = value;
  return image;
}

io::Image Noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  io::Image image = io::MakeImage(width, height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<std::uint8_t>((i / 7 + random() % 64) % 256);
  }
  return image;
}

// The definition, with a dense 11x11 window around each pixel and variances taken apart.
double DenseSsim(const io::Image& a, const io::Image& b, const io::Mask& mask = {}) {
  double total = 0;
  for (int c = 0; c < 3; ++c) {
    double sum = 0;
    int n = 0;
    for (int y = 5; y < a.height - 5; ++y) {
      for (int x = 5; x < a.width - 5; ++x) {
        if (!mask.Uses(static_cast<std::size_t>(y * a.width + x))) continue;
        ++n;
        double weights = 0, ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
        for (int dy = -5; dy <= 5; ++dy) {
          for (int dx = -5; dx <= 5; ++dx) {
            const double w = std::exp(-(dx * dx + dy * dy) / 4.5);
            const double va = a.Pixel(x + dx, y + dy)[c] / 255.0, vb = b.Pixel(x + dx, y + dy)[c] / 255.0;
            weights += w, ma += w * va, mb += w * vb, aa += w * va * va, bb += w * vb * vb, ab += w * va * vb;
          }
        }
        ma /= weights, mb /= weights;
        aa = aa / weights - ma * ma, bb = bb / weights - mb * mb, ab = ab / weights - ma * mb;
        sum += (2 * ma * mb + 1e-4) * (2 * ab + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (aa + bb + 9e-4));
      }
    }
    total += sum / n;
  }
  return total / 3;
}

TEST(Psnr, KnownErrors) {
  EXPECT_NEAR(nerf::PsnrFromMse(nerf::MeanSquaredError(Constant(8, 8, 0), Constant(8, 8, 255))), 0, 1e-12);
  EXPECT_NEAR(
      nerf::PsnrFromMse(nerf::MeanSquaredError(Constant(8, 8, 100), Constant(8, 8, 101))), 48.1308, 1e-4);
  io::Image a = Constant(20, 10, 100), b = a;
  b.Pixel(3, 4)[1] = 101;
  EXPECT_DOUBLE_EQ(nerf::MeanSquaredError(a, b), 1 / (255.0 * 255.0 * 600));
}

TEST(Psnr, IdenticalPicturesStayFinite) {
  EXPECT_EQ(nerf::MeanSquaredError(Noise(16, 16, 1), Noise(16, 16, 1)), 0);
  EXPECT_DOUBLE_EQ(nerf::PsnrFromMse(0), nerf::kMaxPsnrDb);
}

TEST(Psnr, OneGreyLevelInFiveMegapixelsIsBelowTheCap) {
  EXPECT_LT(nerf::PsnrFromMse(1 / (255.0 * 255.0 * 3 * 5e6)), nerf::kMaxPsnrDb);
}

// Channels of 40, 80 and 120 against 20, 100 and 120: gains of 2, 0.8 and 1.
TEST(ColourAlignedError, AGainPerChannelCostsNothing) {
  io::Image truth = io::MakeImage(4, 2, 3), render = truth;
  const std::uint8_t a[] = {40, 80, 120}, b[] = {20, 100, 120};
  for (std::size_t i = 0; i < truth.data.size(); ++i) truth.data[i] = a[i % 3], render.data[i] = b[i % 3];
  EXPECT_GT(nerf::MeanSquaredError(truth, render), 1e-3);
  EXPECT_NEAR(nerf::ColourAlignedError(truth, render), 0, 1e-12);
}

TEST(ColourAlignedError, IsTheLeastOverAllGains) {
  const io::Image truth = Noise(16, 16, 1), render = Noise(16, 16, 2);
  io::Mask mask{16, 16, std::vector<std::uint8_t>(256, 1)};
  for (std::size_t i = 0; i < 100; ++i) mask.used[i] = 0;
  double least = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    double channel = 1e30;
    for (double gain = 0.5; gain < 1.5; gain += 1e-4) {
      double sum = 0;
      for (std::size_t i = 0; i < 256; ++i) {
        const double difference = truth.data[3 * i + c] / 255.0 - gain * render.data[3 * i + c] / 255.0;
        if (mask.Uses(i)) sum += difference * difference;
      }
      channel = std::min(channel, sum);
    }
    least += channel / (3 * 156);
  }
  EXPECT_NEAR(nerf::ColourAlignedError(truth, render, mask), least, 1e-8);
}

TEST(ColourAlignedError, ABlackRenderIsAsFarAsIt) {
  EXPECT_NEAR(nerf::ColourAlignedError(Constant(8, 8, 51), Constant(8, 8, 0)), 0.04, 1e-12);
}

TEST(Metrics, PicturesOfDifferentShapeAreRefused) {
  EXPECT_THROW(nerf::MeanSquaredError(Constant(8, 8, 0), Constant(8, 9, 0)), io::Error);
  EXPECT_THROW(nerf::MeanSquaredError(Constant(8, 8, 0), io::MakeImage(8, 8, 4)), io::Error);
  EXPECT_THROW(nerf::Ssim(Constant(20, 20, 0), Constant(20, 21, 0)), io::Error);
  // One channel is neither averaged nor read past its end.
  EXPECT_THROW(nerf::Ssim(io::MakeImage(20, 20, 1), io::MakeImage(20, 20, 1)), io::Error);
}

// An ellipse in the middle of the picture.
io::Mask Ellipse(int width, int height) {
  io::Mask mask{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = (x + 0.5) / width - 0.5, v = (y + 0.5) / height - 0.5;
      mask.used.push_back(u * u + v * v < 0.09 ? 255 : 0);
    }
  }
  return mask;
}

TEST(MaskedMetrics, AWhiteMaskChangesNoBit) {
  const io::Image a = Noise(70, 51, 1), b = Noise(70, 51, 2);
  const io::Mask white{70, 51, std::vector<std::uint8_t>(70 * 51, 255)};
  EXPECT_EQ(nerf::MeanSquaredError(a, b, white), nerf::MeanSquaredError(a, b));
  EXPECT_EQ(nerf::Ssim(a, b, white), nerf::Ssim(a, b));
  const nerf::FlipMap masked = nerf::Flip(a, b, {}, white), whole = nerf::Flip(a, b);
  EXPECT_EQ(masked.mean, whole.mean);
  EXPECT_EQ(masked.error, whole.error);
}

TEST(MaskedMetrics, AreMeansOverTheUsedPixels) {
  const io::Image a = Noise(70, 51, 1), b = Noise(70, 51, 2);
  const io::Mask mask = Ellipse(70, 51);
  double squares = 0, flip = 0;
  const nerf::FlipMap map = nerf::Flip(a, b, {}, mask);
  for (std::size_t p = 0; p < mask.used.size(); ++p) {
    if (!mask.Uses(p)) continue;
    for (std::size_t c = 0; c < 3; ++c)
      squares += std::pow((a.data[3 * p + c] - b.data[3 * p + c]) / 255.0, 2);
    flip += map.error[p];
  }
  const auto n = static_cast<double>(mask.UsedCount());
  EXPECT_GT(n, 500);
  EXPECT_NEAR(nerf::MeanSquaredError(a, b, mask), squares / (3 * n), 1e-12);
  EXPECT_NEAR(nerf::Ssim(a, b, mask), DenseSsim(a, b, mask), 1e-10);
  EXPECT_NEAR(map.mean, flip / n, 1e-7);  // the map is in float
  EXPECT_GT(std::fabs(nerf::Ssim(a, b, mask) - nerf::Ssim(a, b)), 1e-4);
}

TEST(MaskedMetrics, AnErrorElsewhereChangesNothing) {
  // Used up to column 40, spoiled from column 41 on for the squared error, and beyond the reach of the
  // windows for SSIM (5 pixels) and FLIP (10, three standard deviations of its widest filter).
  const io::Image a = Noise(80, 40, 1), b = Noise(80, 40, 2);
  io::Mask mask{80, 40, {}};
  for (int i = 0; i < 80 * 40; ++i) mask.used.push_back(i % 80 <= 40 ? 255 : 0);
  const auto spoiled = [&](int from) {
    io::Image image = b;
    for (int i = 0; i < 80 * 40 * 3; ++i) {
      if (i / 3 % 80 >= from) image.data[static_cast<std::size_t>(i)] ^= 0xff;
    }
    return image;
  };
  EXPECT_EQ(nerf::MeanSquaredError(a, spoiled(41), mask), nerf::MeanSquaredError(a, b, mask));
  EXPECT_NE(nerf::MeanSquaredError(a, spoiled(40), mask), nerf::MeanSquaredError(a, b, mask));
  EXPECT_EQ(nerf::Ssim(a, spoiled(46), mask), nerf::Ssim(a, b, mask));
  EXPECT_NE(nerf::Ssim(a, spoiled(45), mask), nerf::Ssim(a, b, mask));
  EXPECT_EQ(nerf::Flip(a, spoiled(51), {}, mask).mean, nerf::Flip(a, b, {}, mask).mean);
  EXPECT_NE(nerf::Flip(a, spoiled(50), {}, mask).mean, nerf::Flip(a, b, {}, mask).mean);
}

TEST(MaskedMetrics, MasksThatFitNothingAreRefused) {
  const io::Image a = Constant(20, 20, 1);
  io::Mask turned{10, 40, std::vector<std::uint8_t>(400, 255)},
      black{20, 20, std::vector<std::uint8_t>(400, 0)};
  for (const io::Mask& mask : {turned, black}) {
    EXPECT_THROW(nerf::MeanSquaredError(a, a, mask), io::Error);
    EXPECT_THROW(nerf::Ssim(a, a, mask), io::Error);
    EXPECT_THROW(nerf::Flip(a, a, {}, mask), io::Error);
  }
  io::Mask corner = black;
  corner.used[4 * 20 + 10] = 255;  // no window is centred there
  EXPECT_EQ(nerf::MeanSquaredError(a, a, corner), 0);
  EXPECT_THROW(nerf::Ssim(a, a, corner), io::Error);
  corner.used[5 * 20 + 10] = 255;
  EXPECT_NEAR(nerf::Ssim(a, a, corner), 1, 1e-9);
}

TEST(Ssim, IdenticalIsOne) {
  EXPECT_NEAR(nerf::Ssim(Noise(40, 30, 1), Noise(40, 30, 1)), 1, 1e-12);
  EXPECT_NEAR(nerf::Ssim(Constant(11, 11, 255), Constant(11, 11, 255)), 1, 1e-9);
}

TEST(Ssim, ConstantPicturesLeaveTheLuminanceTerm) {
  const double a = 50 / 255.0, b = 200 / 255.0;
  const double expected = (2 * a * b + 1e-4) / (a * a + b * b + 1e-4);
  EXPECT_NEAR(nerf::Ssim(Constant(30, 20, 50), Constant(30, 20, 200)), expected, 1e-9);
}

TEST(Ssim, AgreesWithTheDenseDefinition) {
  const io::Image a = Noise(37, 26, 1), b = Noise(37, 26, 2);
  const double expected = DenseSsim(a, b);
  EXPECT_GT(expected, 0.1);
  EXPECT_LT(expected, 0.95);
  EXPECT_NEAR(nerf::Ssim(a, b), expected, 1e-10);
}

TEST(Ssim, BelowElevenPixelsIsAnError) {
  EXPECT_ERROR(nerf::Ssim(Constant(10, 40, 1), Constant(10, 40, 1)),
               io::ExitCode::kBadInput,
               "10x40 pixels is not defined");
  EXPECT_NO_THROW(nerf::Ssim(Constant(11, 40, 1), Constant(11, 40, 1)));
}

// Rounding leaves variances of flat windows on either side of zero.
TEST(Ssim, FlatWindowsOfEveryLevelGiveExactlyTheLuminanceTerm) {
  for (int value = 0; value < 256; ++value) {
    const auto level = static_cast<std::uint8_t>(value);
    EXPECT_NEAR(nerf::Ssim(Constant(12, 12, level), Constant(12, 12, level)), 1, 1e-9) << value;
    const double a = value / 255.0, expected = (2 * a + 1e-4) / (a * a + 1 + 1e-4);
    const double ssim = nerf::Ssim(Constant(12, 12, level), Constant(12, 12, 255));
    EXPECT_NEAR(ssim, expected, 1e-9) << value;
  }
}

}  // namespace
