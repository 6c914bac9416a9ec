// Matches of a synthetic capture: who is joined with whom, and how many of them wrongly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "sfm/synthetic/synthetic_capture.h"
#include "tests/support/scenes/capture_truth.h"

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using sfm::MakeSyntheticCapture;
using sfm::MatchGraph;
using sfm::Outliers;
using sfm::Structure;
using sfm::SyntheticCapture;
using sfm::Trajectory;

TEST(SyntheticMatches, EveryPointThatBothSeeIsMatched) {
  const SyntheticCapture capture = MakeSyntheticCapture({.trajectory = Trajectory::kLine, .pictures = 10});
  EXPECT_EQ(capture.matches.size(), 45u);
  for (const sfm::PairMatches& pair : capture.matches) {
    std::size_t common = 0;
    for (const io::Point3D& point : capture.truth.points) {
      const auto sees = [&](int i) {
        return std::count(point.frame_indices.begin(), point.frame_indices.end(), i);
      };
      common += sees(pair.a) == 1 && sees(pair.b) == 1;
    }
    EXPECT_EQ(pair.matches.size(), common);
    EXPECT_LT(common, capture.truth.points.size());  // nobody sees all
  }
}

TEST(SyntheticMatches, OutlierSharesAreExact) {
  int pairs = 0;
  for (const Outliers kind : {Outliers::kUniform, Outliers::kSecondMotion, Outliers::kStaticOverlay}) {
    for (const double share : {0.0, 0.3, 0.9}) {
      const SyntheticCapture capture =
          MakeSyntheticCapture({.pictures = 6, .outliers = kind, .outlier_share = share});
      EXPECT_EQ(capture.matches.size(), 15u);
      for (const sfm::PairMatches& pair : capture.matches) {
        const double wrong = WrongShare(capture, pair);
        const double rounding = 0.5 / static_cast<double>(pair.matches.size());
        EXPECT_LE(wrong, share + rounding);
        // A pair may see too few points of the second body, which has drifted away.
        if (kind != Outliers::kSecondMotion || share < 0.5) {
          EXPECT_GE(wrong, share - rounding);
        }
        std::set<int> in_a, in_b;
        for (const auto& [a, b] : pair.matches) in_a.insert(a), in_b.insert(b);
        EXPECT_EQ(in_a.size(), pair.matches.size()) << "a keypoint has one partner at most";
        EXPECT_EQ(in_b.size(), pair.matches.size());
        ++pairs;
      }
    }
  }
  EXPECT_EQ(pairs, 3 * 3 * 15);
}

// Pixels between the keypoint in b and the epipolar line, by the true poses, of its partner in a.
double EpipolarDistance(const SyntheticCapture& capture, const sfm::PairMatches& pair, int in_a, int in_b) {
  const auto a = static_cast<std::size_t>(pair.a), b = static_cast<std::size_t>(pair.b);
  const io::Camera& camera = capture.truth.cameras[0];
  const io::Rigid3d b_from_a =
      capture.truth.frames[b].world_from_cam.Inverse() * capture.truth.frames[a].world_from_cam;
  const auto ray = [&](std::size_t picture, int keypoint) {
    return *io::RayFromImg(camera,
                           At(capture.features[picture].keypoints[static_cast<std::size_t>(keypoint)]));
  };
  const Vector3d normal = b_from_a.translation.cross(b_from_a.rotation * ray(a, in_a)).normalized();
  return camera.fl_x * std::abs(normal.dot(ray(b, in_b)));
}

TEST(SyntheticMatches, ASecondBodyMovesOnItsOwn) {
  const SyntheticCapture capture =
      MakeSyntheticCapture({.pictures = 6, .outliers = Outliers::kSecondMotion, .outlier_share = 0.4});
  const auto points = PointsOfKeypoints(capture);
  int moved = 0, still = 0, near_its_line = 0;
  for (const sfm::PairMatches& pair : capture.matches) {
    for (const auto& [in_a, in_b] : pair.matches) {
      const bool main = points[static_cast<std::size_t>(pair.a)][static_cast<std::size_t>(in_a)] >= 0;
      const double distance = EpipolarDistance(capture, pair, in_a, in_b);
      (main ? still : moved) += 1;
      if (main) {
        EXPECT_LT(distance, 1e-3);
      }
      near_its_line += !main && distance < 2;
    }
  }
  EXPECT_GT(still, 1000);
  EXPECT_GT(moved, 700);
  EXPECT_LT(near_its_line, moved / 10);
}

TEST(SyntheticMatches, AnOverlayStandsStillInsideItsFrame) {
  const SyntheticCapture capture = MakeSyntheticCapture(
      {.outliers = Outliers::kStaticOverlay, .outlier_share = 0.5, .overlay_border = 0.1});
  const auto points = PointsOfKeypoints(capture);
  int overlay = 0;
  for (const sfm::PairMatches& pair : capture.matches) {
    for (const auto& [in_a, in_b] : pair.matches) {
      const auto a = static_cast<std::size_t>(pair.a), k = static_cast<std::size_t>(in_a);
      if (points[a][k] >= 0) continue;
      const Vector2d at = At(capture.features[a].keypoints[k]);
      EXPECT_EQ(
          at,
          At(capture.features[static_cast<std::size_t>(pair.b)].keypoints[static_cast<std::size_t>(in_b)]));
      EXPECT_LE(
          std::min(std::min(at.x() / 1024, 1 - at.x() / 1024), std::min(at.y() / 768, 1 - at.y() / 768)),
          0.1 + 1e-6);
      ++overlay;
    }
  }
  EXPECT_GT(overlay, 10000);
}

TEST(SyntheticMatches, IdenticalSidesAreConfusedAQuarterTurnApart) {
  const SyntheticCapture capture =
      MakeSyntheticCapture({.structure = Structure::kIdenticalSides, .pictures = 16});
  int neighbours = 0, quarters = 0;
  for (const sfm::PairMatches& pair : capture.matches) {
    const int steps = std::min(pair.b - pair.a, 16 - (pair.b - pair.a));
    const double wrong = WrongShare(capture, pair);
    if (steps == 1) {
      EXPECT_LT(wrong, 0.2);
    }
    if (steps == 4) {
      EXPECT_GT(wrong, 0.8);
    }
    neighbours += steps == 1;
    quarters += steps == 4;
  }
  EXPECT_EQ(neighbours, 16);
  EXPECT_EQ(quarters, 16);
}

// A quarter turn shows the other pair of sides.
TEST(SyntheticMatches, TwoFacadesAreConfusedAHalfTurnApart) {
  const SyntheticCapture capture =
      MakeSyntheticCapture({.structure = Structure::kTwoFacades, .pictures = 16});
  int opposite = 0;
  for (const sfm::PairMatches& pair : capture.matches) {
    if (pair.b - pair.a != 8) continue;
    EXPECT_GT(WrongShare(capture, pair), 0.8);
    ++opposite;
  }
  EXPECT_EQ(opposite, 8);
}

// Tiles are told apart only by the side from which they are seen, and that moves along with the camera.
TEST(SyntheticMatches, TilesAreConfused) {
  const SyntheticCapture capture = MakeSyntheticCapture(
      {.trajectory = Trajectory::kNadirGrid, .structure = Structure::kTiledFloor, .pictures = 16});
  double wrong = 0;
  for (const sfm::PairMatches& pair : capture.matches) wrong += WrongShare(capture, pair);
  EXPECT_GT(wrong / static_cast<double>(capture.matches.size()), 0.5);
}

TEST(SyntheticMatches, MatchGraphs) {
  const auto has = [](const SyntheticCapture& capture, int a, int b) {
    return std::any_of(capture.matches.begin(), capture.matches.end(), [&](const sfm::PairMatches& pair) {
      return pair.a == a && pair.b == b;
    });
  };
  const SyntheticCapture chain =
      MakeSyntheticCapture({.pictures = 10, .graph = MatchGraph::kChain, .chain_overlap = 2});
  EXPECT_EQ(chain.matches.size(), 9u + 8u);
  const SyntheticCapture sparse = MakeSyntheticCapture({.pictures = 10, .graph = MatchGraph::kSparse});
  EXPECT_GT(sparse.matches.size(), 12u);
  EXPECT_LT(sparse.matches.size(), 30u);
  for (int i = 0; i + 1 < 10; ++i) {
    EXPECT_TRUE(has(chain, i, i + 1));
    EXPECT_TRUE(has(sparse, i, i + 1));
  }
}

}  // namespace
