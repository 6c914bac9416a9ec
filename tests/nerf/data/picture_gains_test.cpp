// Exposure and tint of painted pictures: what is found of them, and what evening them out does.
#include "nerf/data/picture_gains.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>

#include "io/base/random.h"

namespace nerf {
namespace {

constexpr int kSide = 96, kPatch = 3, kPerRow = kSide / kPatch, kPoints = 400;

using LogGain = std::function<double(int view, int channel)>;

// Of variance 1.
double Noise(std::uint64_t key, int view, int channel) {
  io::Random random(7, io::Stream::kSplat, key, static_cast<std::uint64_t>(3 * view + channel));
  return std::sqrt(12.0) * (random.Uniform() - 0.5);
}

struct Painting {
  int darkest = 40, brightest = 140;  // levels of the points
  bool is_street = false;             // cameras that look along a line, nearly; else on an arc
};

// Cameras on an arc that look at its middle. All see all points, each as a patch of its own colour.
struct PaintedViews {
  PaintedViews(int n_views, const LogGain& log_gain, const Painting& painting = {}) {
    const io::Camera camera{
        .width = kSide, .height = kSide, .fl_x = 100, .fl_y = 100, .cx = kSide / 2, .cy = kSide / 2};
    for (int v = 0; v < n_views; ++v) {
      const double angle = painting.is_street ? 0.01 * Noise(3, v, 0) : Angle(v);
      const Eigen::AngleAxisd turn(angle, Eigen::Vector3d::UnitY());
      io::Rigid3d world_from_cam;
      world_from_cam.rotation = turn;
      world_from_cam.translation =
          painting.is_street ? Eigen::Vector3d(0, 0, -0.15 * v) : turn * Eigen::Vector3d(0, 0, 4);
      dataset.views.push_back(
          {"view " + std::to_string(v), RayCamera(camera, world_from_cam), kSide, kSide, dataset.n_pixels()});
      dataset.pixels.resize(dataset.pixels.size() + 3 * kSide * kSide, 60);
      for (std::size_t p = 0; p < kPoints; ++p) Paint(v, p, log_gain, painting);
    }
  }

  static double Angle(int view) { return 0.15 * view; }

  void Paint(int v, std::size_t point, const LogGain& log_gain, const Painting& painting) {
    const int x = kPatch * (static_cast<int>(point) % kPerRow),
              y = kPatch * (static_cast<int>(point) / kPerRow);
    const double colour =
        painting.darkest + (painting.brightest - painting.darkest) * (static_cast<double>(point) / kPoints);
    for (int c = 0; c < 3; ++c) {
      const double level = std::min(255.0, colour * std::exp(log_gain(v, c)));
      for (int i = 0; i < kPatch * kPatch; ++i) {
        const auto pixel = static_cast<std::size_t>(((v * kSide) + y + i / kPatch) * kSide + x + i % kPatch);
        dataset.pixels[3 * pixel + static_cast<std::size_t>(c)] =
            static_cast<std::uint8_t>(std::lround(level));
      }
    }
    dataset.depths.push_back({.view = static_cast<std::size_t>(v),
                              .point = point,
                              .x = static_cast<float>(x) + 1.5f,
                              .y = static_cast<float>(y) + 1.5f,
                              .t = 4});
  }

  Dataset dataset;
};

double Own(int view, int channel) { return 0.15 * Noise(0, view, 0) + 0.05 * Noise(1, view, channel); }
double Smooth(int view, int channel) { return 0.25 * std::sin(PaintedViews::Angle(view) + channel); }

// Root mean square of log gain - wanted, but for its mean.
double ErrorOf(const PictureGains& gains, const LogGain& wanted) {
  double squares = 0;
  const auto n = static_cast<double>(gains.size());
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0, sum_squares = 0;
    for (std::size_t v = 0; v < gains.size(); ++v) {
      const double error = std::log(gains[v][c]) - wanted(static_cast<int>(v), static_cast<int>(c));
      sum += error, sum_squares += error * error;
    }
    squares += sum_squares / n - sum / n * (sum / n);
  }
  return std::sqrt(squares / 3);
}

TEST(PictureGains, FindWhatIsEachPicturesOwn) {
  const PaintedViews capture(40, [](int v, int c) { return Own(v, c) + Smooth(v, c); });
  const PictureGains gains = FindPictureGains(capture.dataset);
  ASSERT_EQ(gains.size(), 40u);
  // Own gains spread by 0.16: a sixth of their variance may pass for a smooth change.
  EXPECT_LT(ErrorOf(gains, Own), 0.065);
  EXPECT_NEAR(SpreadOf(gains), 0.15, 0.04);
}

TEST(PictureGains, LeaveWhatFollowsTheCamera) {
  EXPECT_TRUE(FindPictureGains(PaintedViews(40, Smooth).dataset).empty());
  EXPECT_TRUE(FindPictureGains(PaintedViews(40, [](int, int) { return 0.0; }).dataset).empty());
}

TEST(PictureGains, TintAloneIsFound) {
  const LogGain tint = [](int v, int c) { return (c - 1) * 0.1 * Noise(2, v, 0); };
  const PictureGains gains = FindPictureGains(PaintedViews(30, tint).dataset);
  ASSERT_EQ(gains.size(), 30u);
  EXPECT_LT(ErrorOf(gains, tint), 0.04);
}

TEST(PictureGains, OverexposedPointsDoNotCount) {
  // More than half of the points are white in the brightest pictures.
  const PaintedViews capture(30, [](int v, int) { return v % 2 == 0 ? 0.5 : 0.0; }, {.brightest = 400});
  const PictureGains gains = FindPictureGains(capture.dataset);
  ASSERT_EQ(gains.size(), 30u);
  for (std::size_t v = 10; v < 20; v += 2) EXPECT_NEAR(std::log(gains[v][1] / gains[v + 1][1]), 0.5, 0.05);
}

TEST(PictureGains, DarkPointsDoNotCount) {
  const PictureGains gains = FindPictureGains(PaintedViews(40, Own, {.darkest = 0, .brightest = 18}).dataset);
  ASSERT_EQ(gains.size(), 40u);
  EXPECT_LT(ErrorOf(gains, Own), 0.065);
}

TEST(PictureGains, AStreetsDirectionsAreAlike) {
  EXPECT_TRUE(FindPictureGains(PaintedViews(40, Smooth, {.is_street = true}).dataset).empty());
}

TEST(PictureGains, ViewsWithFewPointsAreLeftAlone) {
  PaintedViews capture(30, Own);
  std::erase_if(capture.dataset.depths,
                [](const SparseDepth& depth) { return depth.view == 5 && depth.point >= 10; });
  const PictureGains gains = FindPictureGains(capture.dataset);
  ASSERT_EQ(gains.size(), 30u);
  EXPECT_EQ(gains[5], (std::array<double, 3>{1, 1, 1}));
  EXPECT_NE(gains[6], (std::array<double, 3>{1, 1, 1}));
}

TEST(PictureGains, FewViewsCannotTellRandomFromSmooth) {
  EXPECT_TRUE(FindPictureGains(PaintedViews(6, Own).dataset).empty());
  EXPECT_TRUE(FindPictureGains(Dataset{}).empty());
}

TEST(PictureGains, LargeCapturesAreEvenedInParts) {
  const PaintedViews capture(310, Own);
  const PictureGains gains = FindPictureGains(capture.dataset);
  ASSERT_EQ(gains.size(), 310u);
  EXPECT_LT(ErrorOf(gains, Own), 0.05);
}

TEST(PictureGains, EveningDividesAndKeepsWhite) {
  PaintedViews capture(2, [](int, int) { return 0.0; });
  Dataset& dataset = capture.dataset;
  for (std::size_t level = 0; level < 256; ++level) {
    for (const std::size_t first : {std::size_t{0}, dataset.views[1].first_pixel}) {
      for (std::size_t c = 0; c < 3; ++c)
        dataset.pixels[3 * (first + level) + c] = static_cast<std::uint8_t>(level);
    }
  }
  EvenOut({{1.25, 1, 0.8}, {1, 1, 1}}, &dataset);
  const auto at = [&](std::size_t pixel, std::size_t c) { return int{dataset.pixels[3 * pixel + c]}; };
  for (const std::size_t level : {0u, 10u, 100u, 199u}) {
    EXPECT_EQ(at(level, 0), std::lround(static_cast<double>(level) / 1.25));
    EXPECT_EQ(at(level, 1), static_cast<int>(level));
    EXPECT_EQ(at(level, 2), std::lround(static_cast<double>(level) / 0.8));
  }
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(at(255, c), 255);
    for (std::size_t level = 1; level < 256; ++level) EXPECT_GE(at(level, c), at(level - 1, c));
  }
  const std::size_t second = dataset.views[1].first_pixel;
  EXPECT_EQ(at(second + 77, 0), 77);
}

}  // namespace
}  // namespace nerf
