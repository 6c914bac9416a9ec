// Curvature of a lens, told from matches of generated views.
#include "sfm/features/lens_curvature.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace {

constexpr int kWidth = 1600, kHeight = 1200;
constexpr double kHalfDiagonal = 1000;

// Radius [px] at which a lens shows what lies off its axis by so many radians.
using Lens = std::function<double(double)>;

Lens Pinhole(double focal_px) {
  return [=](double angle) { return focal_px * std::tan(angle); };
}
Lens Equidistant(double focal_px) {
  return [=](double angle) { return focal_px * angle; };
}
Lens Equisolid(double focal_px) {
  return [=](double angle) { return 2 * focal_px * std::sin(angle / 2); };
}
// A phone's or a wide-angle lens.
Lens Barrel(double focal_px, double k1) {
  return [=](double angle) {
    const double t = std::tan(angle);
    return focal_px * t * (1 + k1 * t * t);
  };
}

struct Capture {
  std::vector<sfm::Features> features;
  std::vector<sfm::PairMatches> pairs;
};

// Six pictures of points around a walk sideways; a fifth of the matches are wrong.
class SidewaysWalk {
 public:
  explicit SidewaysWalk(bool is_flat = false) {
    for (int i = 0; i < 500; ++i)
      points_.push_back({Number(-9, 9), Number(-7, 7), is_flat ? 5 : Number(2, 9)});
  }

  // ahead: it goes straight ahead instead, without a turn.
  Capture Seen(const Lens& lens, bool ahead = false) {
    Capture capture{std::vector<sfm::Features>(kPictures), {}};
    for (int i = 0; i < kPictures; ++i) {
      const Eigen::AngleAxisd turn(ahead ? 0 : 0.06 * (i - 2), Eigen::Vector3d(0.2, 1, 0.1).normalized());
      const Eigen::Vector3d centre =
          ahead ? Eigen::Vector3d(0, 0, 0.3 * i) : Eigen::Vector3d(0.5 * i, 0.1 * i, 0.05 * i * i);
      for (const Eigen::Vector3d& point : points_)
        capture.features[static_cast<std::size_t>(i)].keypoints.push_back(
            Projected(lens, turn.toRotationMatrix() * (point - centre)));
    }
    for (int a = 0; a < kPictures; ++a) {
      for (int b = a + 1; b < kPictures; ++b) capture.pairs.push_back(Matched(capture, a, b));
    }
    return capture;
  }

 private:
  static constexpr int kPictures = 6;

  double Number(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  // Outside of the picture where it shows nothing.
  sfm::Keypoint Projected(const Lens& lens, const Eigen::Vector3d& x) {
    const double angle = std::atan2(std::hypot(x.x(), x.y()), x.z());
    if (angle > 1.45) return {-1, -1};
    std::normal_distribution<double> noise(0, 0.4);
    const Eigen::Vector2d at = lens(angle) * x.head<2>().normalized();
    return {static_cast<float>(kWidth / 2 + at.x() + noise(random_)),
            static_cast<float>(kHeight / 2 + at.y() + noise(random_))};
  }

  sfm::PairMatches Matched(const Capture& capture, int a, int b) {
    const auto is_inside = [](const sfm::Keypoint& k) {
      return k.x > 0 && k.y > 0 && k.x < kWidth && k.y < kHeight;
    };
    const auto &in_a = capture.features[static_cast<std::size_t>(a)].keypoints,
               &in_b = capture.features[static_cast<std::size_t>(b)].keypoints;
    std::vector<int> seen;
    for (int i = 0; i < static_cast<int>(points_.size()); ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (is_inside(in_a[at]) && is_inside(in_b[at])) seen.push_back(i);
    }
    sfm::PairMatches pair{a, b, {}};
    for (std::size_t i = 0; i < seen.size(); ++i)
      pair.matches.push_back({seen[i], i % 5 == 0 ? seen[(i + 7) % seen.size()] : seen[i]});
    return pair;
  }

  std::mt19937 random_{1};
  std::vector<Eigen::Vector3d> points_;
};

sfm::LensCurvature Find(const Capture& capture, int threads = 2) {
  return sfm::FindLensCurvature(capture.features, capture.pairs, kWidth, kHeight, threads);
}

TEST(LensCurvature, RadiiOfLensAndPinholeCameraAreInverse) {
  for (const double curvature : {0.0, -0.2, -0.6, -2.5}) {
    for (const double r_pinhole : {0.0, 1e-6, 0.3, 1.7, 40.0})
      EXPECT_NEAR(sfm::PinholeRadius(curvature, sfm::LensRadius(curvature, r_pinhole)),
                  r_pinhole,
                  1e-10 * (1 + r_pinhole * r_pinhole));
  }
  EXPECT_TRUE(std::isinf(sfm::PinholeRadius(-1, 1))) << "90 degrees off the axis";
  EXPECT_TRUE(std::isinf(sfm::PinholeRadius(-1, 1.2)));
}

TEST(LensCurvature, FisheyesAreFoundWithTheirFocalLength) {
  // 88, 114 (action cameras) and 153 degrees across 1600 pixels.
  for (const double focal_px : {1040., 800., 600.}) {
    for (const Lens& lens : {Equidistant(focal_px), Equisolid(focal_px)}) {
      const sfm::LensCurvature found = Find(SidewaysWalk().Seen(lens));
      ASSERT_LT(found.curvature, 0) << focal_px;
      EXPECT_NEAR(sfm::FisheyeFocal(found.curvature) * kHalfDiagonal, focal_px, 0.15 * focal_px);
      EXPECT_GT(found.agreeing, 0.7);
      EXPECT_LT(found.agreeing_pinhole, found.agreeing / 1.06);
    }
  }
}

TEST(LensCurvature, WhatIsFoundShowsStraightLinesStraight) {
  const double focal_px = 800;
  const sfm::LensCurvature found = Find(SidewaysWalk().Seen(Equidistant(focal_px)));
  // Angles up to 50 degrees: the pinhole radius is the tangent, times one focal length for all.
  const auto pinhole = [&](double degrees) {
    const double angle = degrees * std::numbers::pi / 180;
    return sfm::PinholeRadius(found.curvature, focal_px * angle / kHalfDiagonal) / std::tan(angle);
  };
  for (const double degrees : {10., 25., 40., 50.})
    EXPECT_NEAR(pinhole(degrees) / pinhole(1), 1, 0.04) << degrees;
}

TEST(LensCurvature, PhonesAndWideAngleLensesAreLeftAsTheyAre) {
  for (const Lens& lens : {Pinhole(1300), Pinhole(800), Barrel(1300, -0.06), Barrel(1000, -0.05)})
    EXPECT_EQ(Find(SidewaysWalk().Seen(lens)).curvature, 0);
}

TEST(LensCurvature, AFlatSceneSaysNothingWrong) {
  EXPECT_EQ(Find(SidewaysWalk(true).Seen(Pinhole(1000))).curvature, 0);
  EXPECT_EQ(Find(SidewaysWalk(true).Seen(Barrel(1300, -0.06))).curvature, 0);
}

// Lines through the middle are straight in pictures of any lens: all curvatures explain as much.
TEST(LensCurvature, AWalkStraightAheadSaysNothing) {
  for (const double focal_px : {800., 1000., 1300., 2000.})
    EXPECT_EQ(Find(SidewaysWalk().Seen(Pinhole(focal_px), true)).curvature, 0) << focal_px;
}

TEST(LensCurvature, FewMatchesSayNothing) {
  Capture capture = SidewaysWalk().Seen(Equidistant(800));
  EXPECT_EQ(Find({capture.features, {}}).curvature, 0);
  Capture few = capture;
  few.pairs.resize(4);
  EXPECT_EQ(Find(few).curvature, 0) << "pairs";
  for (sfm::PairMatches& pair : capture.pairs) pair.matches.resize(59);
  EXPECT_EQ(Find(capture).curvature, 0) << "matches";
}

TEST(LensCurvature, ThreadsDoNotMatter) {
  const Capture capture = SidewaysWalk().Seen(Equidistant(800));
  EXPECT_EQ(Find(capture, 1).curvature, Find(capture, 3).curvature);
}

}  // namespace
