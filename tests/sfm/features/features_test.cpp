// Positions, masks and order of detected features, on pictures drawn with known centres.
#include "sfm/features/features.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "io/image/image.h"
#include "io/image/mask.h"
#include "tests/support/files/temp_dir.h"

namespace {

struct Spot {
  double x, y, sigma;
};

// Gaussian spots on grey; the centre of the top-left pixel is (0.5, 0.5).
io::Image Draw(int width, int height, const std::vector<Spot>& spots) {
  io::Image image = io::MakeImage(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double value = 60;
      for (const Spot& s : spots) {
        const double d2 = std::pow(x + 0.5 - s.x, 2) + std::pow(y + 0.5 - s.y, 2);
        value += 160 * std::exp(-d2 / (2 * s.sigma * s.sigma));
      }
      for (int c = 0; c < 3; ++c)
        image.Pixel(x, y)[c] = static_cast<std::uint8_t>(std::lround(std::min(255.0, value)));
    }
  }
  return image;
}

std::vector<Spot> Spots() {
  std::vector<Spot> spots;
  for (int i = 0; i < 24; ++i) {
    spots.push_back(
        {60.0 + 70 * (i % 6) + 0.37 * (i % 5), 50.0 + 80 * (i / 6) + 0.29 * (i % 7), 2.5 + 0.35 * (i % 8)});
  }
  return spots;
}

// Mean displacement of the keypoints nearest to the spots, over the spots that have one within a pixel: a
// spot that is symmetric on the pixel grid can lack a strict extremum.
std::array<double, 2> MeanDisplacement(const sfm::Features& features,
                                       const std::vector<Spot>& spots,
                                       double scale) {
  double dx = 0, dy = 0;
  int n = 0;
  for (const Spot& s : spots) {
    const sfm::Keypoint* nearest = nullptr;
    const auto distance = [&](const sfm::Keypoint& k) {
      return std::hypot(k.x - scale * s.x, k.y - scale * s.y);
    };
    for (const sfm::Keypoint& k : features.keypoints) {
      if (!nearest || distance(k) < distance(*nearest)) nearest = &k;
    }
    if (distance(*nearest) > scale) continue;
    dx += nearest->x - scale * s.x;
    dy += nearest->y - scale * s.y;
    ++n;
  }
  EXPECT_GE(n, 20);
  return {dx / n, dy / n};
}

TEST(Features, PixelCentresAreAtOneHalf) {
  TempDir folder;
  io::WriteImage(folder / "spots.png", Draw(480, 360, Spots()));
  const sfm::Features features = sfm::DetectFeatures(folder.path(), {"spots.png"}, "", {})[0];
  ASSERT_GE(features.keypoints.size(), 24u);
  // A convention off by half a pixel, or OpenCV's quarter, shows as a mean of that size; the spots' own
  // detection noise averages to less than 0.03 px.
  const auto [dx, dy] = MeanDisplacement(features, Spots(), 1);
  EXPECT_NEAR(dx, 0, 0.03);
  EXPECT_NEAR(dy, 0, 0.03);
}

// Faint spots beside strong ones, as cables on a desk beside a window.
TEST(Features, EvenContrastShowsWhatIsFaint) {
  TempDir folder;
  io::Image image = Draw(480, 360, Spots());
  for (int y = 0; y < 360; ++y) {
    for (int x = 0; x < 240; ++x) {
      for (int c = 0; c < 3; ++c)
        image.Pixel(x, y)[c] = static_cast<std::uint8_t>(60 + image.Pixel(x, y)[c] / 20);
    }
  }
  io::WriteImage(folder / "faint.png", image);
  const auto faint = [&](bool even_contrast) {
    const sfm::Features features =
        sfm::DetectFeatures(folder.path(), {"faint.png"}, "", {.even_contrast = even_contrast})[0];
    return std::count_if(features.keypoints.begin(), features.keypoints.end(), [](const sfm::Keypoint& k) {
      return k.x < 220;
    });
  };
  EXPECT_LT(faint(false), 6);
  EXPECT_GE(faint(true), 12);
}

TEST(Features, DetectionInASmallerPictureKeepsThePositions) {
  TempDir folder;
  std::vector<Spot> spots = Spots();
  for (Spot& s : spots) s = {3 * s.x, 3 * s.y, 3 * s.sigma};
  io::WriteImage(folder / "large.png", Draw(1440, 1080, spots));
  const sfm::Features features =
      sfm::DetectFeatures(folder.path(), {"large.png"}, "", {.max_image_size = 480})[0];
  const auto [dx, dy] = MeanDisplacement(features, Spots(), 3);
  EXPECT_NEAR(dx, 0, 0.09);  // 0.03 px of the small picture
  EXPECT_NEAR(dy, 0, 0.09);
  // Detection sees the means of 3 x 3 pixels.
  const io::Image large = Draw(1440, 1080, spots);
  io::Image small = io::MakeImage(480, 360, 3);
  for (int y = 0; y < 360; ++y) {
    for (int x = 0; x < 480; ++x) {
      int sum = 0;
      for (int k = 0; k < 9; ++k) sum += large.Pixel(3 * x + k % 3, 3 * y + k / 3)[0];
      std::fill_n(small.Pixel(x, y), 3, static_cast<std::uint8_t>(std::lround(sum / 9.0)));
    }
  }
  io::WriteImage(folder / "small.png", small);
  const sfm::Features expected = sfm::DetectFeatures(folder.path(), {"small.png"}, "", {})[0];
  EXPECT_EQ(features.descriptors, expected.descriptors);
  ASSERT_EQ(features.keypoints.size(), expected.keypoints.size());
  for (std::size_t i = 0; i < expected.keypoints.size(); ++i) {
    EXPECT_FLOAT_EQ(features.keypoints[i].scale, 3 * expected.keypoints[i].scale) << i;
    EXPECT_EQ(features.keypoints[i].angle, expected.keypoints[i].angle) << i;
  }
}

// 100 rows become 33: heights shrink by more than widths.
TEST(Features, DetectionInASmallerPictureOfOtherProportionsKeepsThePositions) {
  TempDir folder;
  std::vector<Spot> spots, small;
  for (int i = 0; i < 30; ++i) spots.push_back({50.3 + 46 * i, 45.0 + i % 11, 6.0 + 0.2 * (i % 5)});
  for (const Spot& s : spots) small.push_back({s.x / 3, s.y / 3, s.sigma / 3});
  io::WriteImage(folder / "strip.png", Draw(1440, 100, spots));
  const sfm::Features features =
      sfm::DetectFeatures(folder.path(), {"strip.png"}, "", {.max_image_size = 480})[0];
  const auto [dx, dy] = MeanDisplacement(features, small, 3);
  EXPECT_NEAR(dx, 0, 0.09);
  EXPECT_NEAR(dy, 0, 0.09);
}

TEST(Features, TheScaleIsTheSizeOfTheSpot) {
  TempDir folder;
  io::WriteImage(folder / "spots.png", Draw(480, 360, Spots()));
  const sfm::Features features = sfm::DetectFeatures(folder.path(), {"spots.png"}, "", {})[0];
  int n = 0;
  for (const sfm::Keypoint& k : features.keypoints) {
    for (const Spot& s : Spots()) {
      if (std::hypot(k.x - s.x, k.y - s.y) > 1) continue;
      EXPECT_NEAR(k.scale / s.sigma, 1, 0.2) << s.sigma;
      ++n;
    }
  }
  EXPECT_GE(n, 20);
}

// Pairs of unequal spots have a direction.
TEST(Features, AnglesTurnWithThePicture) {
  TempDir folder;
  std::vector<Spot> spots, turned;
  for (int i = 0; i < 12; ++i) {
    const double x = 90.3 + 100 * (i % 4), y = 80.1 + 100 * (i / 4), angle = 0.5 * i;
    spots.push_back({x, y, 5});
    spots.push_back({x + 8 * std::cos(angle), y + 8 * std::sin(angle), 3});
  }
  for (const Spot& s : spots) turned.push_back({360 - s.y, s.x, s.sigma});  // x becomes y, y becomes -x
  io::WriteImage(folder / "a.png", Draw(480, 360, spots));
  io::WriteImage(folder / "b.png", Draw(360, 480, turned));
  const auto features = sfm::DetectFeatures(folder.path(), {"a.png", "b.png"}, "", {});
  int n = 0;
  for (const sfm::Keypoint& a : features[0].keypoints) {
    double nearest = 10;
    for (const sfm::Keypoint& b : features[1].keypoints) {
      if (std::hypot(b.x - (360 - a.y), b.y - a.x) > 0.3 || std::abs(b.scale / a.scale - 1) > 0.05) continue;
      nearest = std::min(nearest, std::abs(std::remainder(b.angle - a.angle - M_PI / 2, 2 * M_PI)));
    }
    n += nearest < 0.05;
  }
  // Of 39; where two directions are about as strong, another one may win on turned pixels.
  EXPECT_GE(n, 15);
}

TEST(Features, DescriptorsAreRootSift) {
  TempDir folder;
  io::WriteImage(folder / "spots.png", Draw(480, 360, Spots()));
  const sfm::Features features = sfm::DetectFeatures(folder.path(), {"spots.png"}, "", {})[0];
  ASSERT_EQ(features.descriptors.size(), features.keypoints.size() * sfm::kDescriptorBytes);
  for (std::size_t i = 0; i < features.keypoints.size(); ++i) {
    double norm2 = 0;
    for (std::size_t k = 0; k < sfm::kDescriptorBytes; ++k)
      norm2 += std::pow(features.descriptors[i * sfm::kDescriptorBytes + k], 2);
    // Rounding moves each of 128 entries by at most 1/2: 512 -+ 5.7.
    EXPECT_NEAR(std::sqrt(norm2), 512, 5.7) << i;
  }
}

TEST(Features, TheStrongestAreKeptWhateverTheThreads) {
  TempDir folder;
  io::WriteImage(folder / "a.png", Draw(480, 360, Spots()));
  io::WriteImage(folder / "b.png", Draw(480, 360, {{100, 100, 3}, {200, 150, 4}}));
  const auto all = sfm::DetectFeatures(folder.path(), {"a.png", "b.png"}, "", {.threads = 1});
  const auto few =
      sfm::DetectFeatures(folder.path(), {"a.png", "b.png"}, "", {.max_features = 10, .threads = 2});
  ASSERT_EQ(few[0].keypoints.size(), 10u);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(few[0].keypoints[i].x, all[0].keypoints[i].x) << i;
  for (std::size_t i = 0; i < 10; ++i) {
    const auto& keypoints = all[0].keypoints;
    const auto same = std::find_if(keypoints.begin(), keypoints.end(), [&](const sfm::Keypoint& k) {
      return k.x == few[0].keypoints[i].x && k.angle == few[0].keypoints[i].angle;
    });
    ASSERT_NE(same, keypoints.end()) << i;
    const auto row = all[0].descriptors.begin() + (same - keypoints.begin()) * sfm::kDescriptorBytes;
    EXPECT_TRUE(std::equal(row, row + sfm::kDescriptorBytes, &few[0].descriptors[i * sfm::kDescriptorBytes]))
        << i;
  }
  EXPECT_EQ(few[1].descriptors, all[1].descriptors);
}

TEST(Features, NothingIsFoundBehindAMask) {
  TempDir folder, masks;
  io::WriteImage(folder / "a.jpg", Draw(480, 360, Spots()));
  io::Mask mask{480, 360, std::vector<std::uint8_t>(480 * 360)};
  for (std::size_t p = 0; p < mask.used.size(); ++p) mask.used[p] = p % 480 < 240 ? 0 : 255;
  io::WriteMask(masks / "a.png", mask);
  for (const int size : {480, 240}) {
    const sfm::Features features =
        sfm::DetectFeatures(folder.path(), {"a.jpg"}, masks.path(), {.max_image_size = size})[0];
    ASSERT_GT(features.keypoints.size(), 5u);
    for (const sfm::Keypoint& k : features.keypoints) EXPECT_GT(k.x, 239) << size << " " << k.y;
  }
}

TEST(Features, APictureWithoutAMaskIsUsedWhole) {
  TempDir folder, masks;
  for (const char* name : {"a.jpg", "b.jpg"}) io::WriteImage(folder / name, Draw(480, 360, Spots()));
  io::WriteMask(masks / "a.png", {480, 360, std::vector<std::uint8_t>(480 * 360, 255)});
  const auto masked = sfm::DetectFeatures(folder.path(), {"a.jpg", "b.jpg"}, masks.path(), {}),
             whole = sfm::DetectFeatures(folder.path(), {"a.jpg", "b.jpg"}, "", {});
  ASSERT_GT(whole[1].keypoints.size(), 20u);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(masked[i].descriptors, whole[i].descriptors) << i;
}

TEST(Features, UnreadablePicturesAndWrongMasksAreNamed) {
  TempDir folder, masks;
  io::WriteImage(folder / "a.png", Draw(480, 360, Spots()));
  io::WriteImage(masks / "a.png", Draw(100, 100, {}));
  EXPECT_ERROR(sfm::DetectFeatures(folder.path(), {"missing.png"}, "", {.threads = 2}),
               io::ExitCode::kBadInput,
               "missing.png: no such file");
  WriteText(folder / "cut.png", ReadText(folder / "a.png").substr(0, 60));  // its size is there
  EXPECT_ERROR(sfm::DetectFeatures(folder.path(), {"cut.png"}, "", {.threads = 2}),
               io::ExitCode::kBadInput,
               "cut.png: cannot be read as a picture");
  EXPECT_ERROR(sfm::DetectFeatures(folder.path(), {"a.png"}, masks.path(), {.threads = 2}),
               io::ExitCode::kBadInput,
               "a.png");
}

TEST(Features, LargestFirst) {
  sfm::Features features;
  for (int i = 0; i < 5; ++i) {
    features.keypoints.push_back({.x = static_cast<float>(i), .scale = static_cast<float>((i * 3) % 5)});
    features.descriptors.insert(
        features.descriptors.end(), sfm::kDescriptorBytes, static_cast<std::uint8_t>(i));
  }
  const sfm::Features largest = sfm::LargestFeatures(features, 2);
  ASSERT_EQ(largest.keypoints.size(), 2u);
  EXPECT_EQ(largest.keypoints[0].x, 3);  // scale 4
  EXPECT_EQ(largest.keypoints[1].x, 1);  // scale 3
  EXPECT_EQ(largest.descriptors[sfm::kDescriptorBytes], 1);
}

TEST(DetectionBytes, ArePaidPerPixelOfTheDetectionSize) {
  EXPECT_NEAR(sfm::DetectionBytes(1600, 1200, {.max_image_size = 1600}) / 1.92e6, 238, 1);
  EXPECT_NEAR(sfm::DetectionBytes(4000, 3000, {.max_image_size = 0}) / 12e6, 238, 1);
  EXPECT_NEAR(sfm::DetectionBytes(3200, 2400, {.max_image_size = 1600}) / 1.92e6, 235 + 16, 1);
}

}  // namespace
