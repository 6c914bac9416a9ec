// Which matches one rigid scene explains: scenes with truth, seen from two places.
#include "sfm/features/two_view.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace {

using sfm::TwoViewKind;
using Match = std::array<int, 2>;

constexpr double kFocalPx = 900, kMiddleX = 512, kMiddleY = 384;

// Two views of points: matches are (i, i + 1), mismatches follow the true ones.
class Views {
 public:
  Views(int n_points, double depth, const Eigen::Vector3d& baseline) {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()).toRotationMatrix();
    b_.push_back({});
    for (int i = 0; i < n_points; ++i) {
      const Eigen::Vector3d x(Number(-2, 2), Number(-1.5, 1.5), 5 + depth * Number(-1, 1));
      Add(Projected(x), Projected(turn * (x - baseline)), 0.5);
    }
  }

  void AddMismatches(int n) {
    for (int i = 0; i < n; ++i) {
      Add({Number(0, 2 * kMiddleX), Number(0, 2 * kMiddleY)},
          {Number(0, 2 * kMiddleX), Number(0, 2 * kMiddleY)},
          0);
    }
  }

  // Of all matches, or of the first n.
  sfm::TwoViewGeometry Explained() const { return Explained(matches_.size()); }
  sfm::TwoViewGeometry Explained(std::size_t n) const {
    std::vector<Match> some = matches_;
    some.resize(n);
    return sfm::EstimateTwoViewGeometry(a_, b_, some);
  }

  const std::vector<Match>& matches() const { return matches_; }
  sfm::Features A() const { return {a_, {}}; }
  sfm::Features B() const { return {b_, {}}; }

 private:
  double Number(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  static Eigen::Vector2d Projected(const Eigen::Vector3d& x) {
    return kFocalPx * x.hnormalized() + Eigen::Vector2d(kMiddleX, kMiddleY);
  }
  void Add(Eigen::Vector2d a, Eigen::Vector2d b, double noise_px) {
    std::normal_distribution<double> noise(0, 1);
    for (Eigen::Vector2d* at : {&a, &b}) *at += noise_px * Eigen::Vector2d(noise(random_), noise(random_));
    matches_.push_back({static_cast<int>(a_.size()), static_cast<int>(b_.size())});
    a_.push_back({static_cast<float>(a.x()), static_cast<float>(a.y())});
    b_.push_back({static_cast<float>(b.x()), static_cast<float>(b.y())});
  }

  std::mt19937_64 random_{5};
  std::vector<sfm::Keypoint> a_, b_;
  std::vector<Match> matches_;
};

const Eigen::Vector3d kBaseline(1, 0.1, -0.2);

std::size_t CountBelow(const std::vector<Match>& matches, int keypoint) {
  return static_cast<std::size_t>(
      std::count_if(matches.begin(), matches.end(), [&](const Match& m) { return m[0] < keypoint; }));
}

// In the second case three fifths are mismatches: one sample of seven in 600 has none.
TEST(TwoView, AScenesMatchesAreExplainedAndMismatchesAreNot) {
  for (const auto& [n, n_mismatches] : {std::pair(200, 200), {80, 120}}) {
    Views views(n, 2, kBaseline);
    views.AddMismatches(n_mismatches);
    const sfm::TwoViewGeometry geometry = views.Explained();
    const std::size_t right = CountBelow(geometry.matches, n);
    EXPECT_EQ(geometry.kind, TwoViewKind::kEpipolar);
    EXPECT_GE(right, static_cast<std::size_t>(n - 2));
    // A line of 8 pixels' width in a picture of 768 meets one in 60 to 100 by chance.
    EXPECT_LE(geometry.matches.size() - right, 10u);
    EXPECT_TRUE(std::is_sorted(geometry.matches.begin(), geometry.matches.end()));
  }
}

TEST(TwoView, APlaneAndARotationLeaveAHomography) {
  for (const auto& [depth, baseline] : {std::pair(0.0, kBaseline), {2.0, Eigen::Vector3d::Zero().eval()}}) {
    Views views(100, depth, baseline);
    views.AddMismatches(60);
    const sfm::TwoViewGeometry geometry = views.Explained();
    EXPECT_EQ(geometry.kind, TwoViewKind::kHomography) << depth;
    EXPECT_GE(CountBelow(geometry.matches, 100), 99u);
    EXPECT_LE(geometry.matches.size(), 108u);
  }
}

TEST(TwoView, FewOrUnrelatedMatchesExplainNothing) {
  Views scene(30, 2, kBaseline), chance(0, 2, kBaseline);
  chance.AddMismatches(60);
  EXPECT_EQ(scene.Explained(sfm::kLeastTwoViewMatches - 1).kind, TwoViewKind::kNone);
  EXPECT_EQ(scene.Explained(sfm::kLeastTwoViewMatches + 1).kind, TwoViewKind::kEpipolar);
  EXPECT_EQ(chance.Explained().kind, TwoViewKind::kNone);
  EXPECT_TRUE(chance.Explained().matches.empty());
}

// No sample of them has a model.
TEST(TwoView, PointsInOnePlaceExplainNothing) {
  const std::vector<sfm::Keypoint> same(40, {100, 200});
  std::vector<Match> matches;
  for (int i = 0; i < 40; ++i) matches.push_back({i, i});
  EXPECT_EQ(sfm::EstimateTwoViewGeometry(same, same, matches).kind, TwoViewKind::kNone);
  EXPECT_EQ(sfm::EstimateTwoViewGeometry({}, {}, {}).kind, TwoViewKind::kNone);
}

TEST(TwoView, PairsAreTheSameOnAnyNumberOfThreads) {
  Views scene(60, 2, kBaseline), plane(60, 0, kBaseline);
  scene.AddMismatches(30);
  const std::vector<sfm::Features> features = {scene.A(), scene.B(), plane.A(), plane.B()};
  const std::vector<sfm::PairMatches> pairs = {
      {0, 1, scene.matches()}, {2, 3, plane.matches()}, {0, 1, {}}, {0, 1, scene.matches()}};
  const auto one = sfm::EstimateTwoViewGeometries(features, pairs, 1),
             three = sfm::EstimateTwoViewGeometries(features, pairs, 3);
  ASSERT_EQ(one.size(), 4u);
  EXPECT_EQ(one[0].kind, TwoViewKind::kEpipolar);
  EXPECT_EQ(one[1].kind, TwoViewKind::kHomography);
  EXPECT_EQ(one[2].kind, TwoViewKind::kNone);
  EXPECT_EQ(one[3].matches, one[0].matches);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(three[i].kind, one[i].kind);
    EXPECT_EQ(three[i].matches, one[i].matches);
  }
}

}  // namespace
