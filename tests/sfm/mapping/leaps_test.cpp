// A walk that leaps to a place it shares few points with was taken for somewhere else.
#include "sfm/mapping/leaps.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

namespace {

// Picture i stands at x = i; those from `leap` on stand elsewhere and look elsewhere.
struct WalkAround {
  io::Scene scene;
  std::vector<std::string> names;

  explicit WalkAround(int n, int leap = 1000, double turn_deg = 170, double move = 0) {
    for (int i = 0; i < n; ++i) {
      names.push_back("p" + std::to_string(100 + i));
      io::Frame frame{.image_path = names.back()};
      const double beyond = i >= leap ? 1 : 0;
      frame.world_from_cam.rotation =
          Eigen::AngleAxisd((10 * i + beyond * turn_deg) * std::numbers::pi / 180, Eigen::Vector3d::UnitY())
              .toRotationMatrix();
      frame.world_from_cam.translation = {i + beyond * move, 0, 0};
      scene.frames.push_back(frame);
    }
  }
  // Points that these pictures see.
  void Add(int n, std::vector<int> frames) {
    for (int i = 0; i < n; ++i) scene.points.push_back({.frame_indices = frames});
  }
  std::size_t Beyond() const { return sfm::PicturesBeyondLeaps(scene, names).size(); }
};

TEST(Leaps, APartThatAWalkCannotHaveReachedGoes) {
  WalkAround walk(20, 14);
  walk.Add(100, {14, 15, 16, 17, 18, 19});
  walk.Add(11, {3, 4, 16});
  walk.Add(500, {0, 5, 13});
  const std::set<std::string> beyond = sfm::PicturesBeyondLeaps(walk.scene, walk.names);
  EXPECT_EQ(beyond, (std::set<std::string>{"p114", "p115", "p116", "p117", "p118", "p119"}));
}

TEST(Leaps, ATenthOfItsPointsHoldsAPart) {
  for (const int shared : {11, 12}) {
    WalkAround walk(20, 14);
    walk.Add(100, {14, 15, 19});
    walk.Add(shared, {3, 4, 16});
    EXPECT_EQ(walk.Beyond(), shared == 11 ? 6u : 0u);
  }
}

TEST(Leaps, TurnsAndMovesCount) {
  // Steps of a walk turn by 10 degrees and move by 1: a leap turns by more than 60, or moves by more than 6.
  EXPECT_EQ(WalkAround(20, 14, 49).Beyond(), 0u);
  for (const bool leaps : {false, true}) {
    for (const bool turns : {false, true}) {
      WalkAround walk(20, 14, turns ? (leaps ? 51 : 49) : 0, turns ? 0 : (leaps ? 5.1 : 4.9));
      walk.Add(100, {14, 15, 19});
      EXPECT_EQ(walk.Beyond(), leaps ? 6u : 0u) << turns;
    }
  }
}

TEST(Leaps, PicturesInNoOrderHaveNone) {
  // Each turns by 100 degrees from the one before.
  WalkAround walk(20);
  for (std::size_t i = 0; i < 20; ++i) {
    walk.scene.frames[i].world_from_cam.rotation =
        Eigen::AngleAxisd(static_cast<double>(i) * 100 * std::numbers::pi / 180, Eigen::Vector3d::UnitY())
            .toRotationMatrix();
  }
  walk.Add(100, {14, 15, 19});
  EXPECT_EQ(walk.Beyond(), 0u);
}

TEST(Leaps, WhereManyPicturesAreMissingAWalkMayTurn) {
  for (const std::size_t missing : {2u, 3u}) {
    WalkAround walk(20, 14);
    walk.Add(100, {14, 15, 19});
    for (std::size_t i = 0; i < missing; ++i) walk.names.insert(walk.names.begin() + 14, "missing");
    EXPECT_EQ(walk.Beyond(), missing == 2 ? 6u : 0u);
  }
}

TEST(Leaps, FewStepsTellNoHabit) {
  for (const int n : {10, 11}) {
    WalkAround walk(n, 7);
    walk.Add(100, {7, 8});
    EXPECT_EQ(walk.Beyond(), n == 10 ? 0u : 4u);
  }
}

TEST(Leaps, TheLargerPartStays) {
  WalkAround walk(20, 5);
  walk.Add(100, {0, 1, 2});
  walk.Add(100, {7, 8, 9});
  EXPECT_EQ(walk.Beyond(), 5u);
  EXPECT_EQ(sfm::PicturesBeyondLeaps(io::Scene(), {}).size(), 0u);
}

}  // namespace
