// Every kind of path moves evenly, and a path that halts and leaps is timed anew.
#include "nerf/paths/even_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/base/median.h"
#include "tests/support/scenes/look_at.h"

namespace {

using Eigen::Vector3d;
using nerf::CameraPath;
using nerf::PathKind;
using std::numbers::pi;

constexpr int kFrames = 90;

// At an azimuth and an elevation in degrees, looking at the origin.
io::Rigid3d Around(double azimuth_deg, double elevation_deg, double distance) {
  const double a = azimuth_deg * pi / 180, e = elevation_deg * pi / 180;
  return LookAt(distance * Vector3d(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)),
                Vector3d::Zero(),
                Vector3d::UnitZ());
}

io::Rigid3d Ahead(const Vector3d& place, const Vector3d& direction) {
  return LookAt(place, place + direction, Vector3d::UnitZ());
}

CameraPath FilmOf(const std::vector<io::Rigid3d>& poses) {
  io::Scene scene;
  scene.cameras.push_back({.width = 80, .height = 60, .fl_x = 80, .fl_y = 80, .cx = 40, .cy = 30});
  for (const io::Rigid3d& pose : poses) scene.frames.push_back({"", 0, pose, {}});
  CameraPath path = nerf::FitCameraPath(scene, 4 * kFrames);
  const std::vector<io::Rigid3d> fitted = path.world_from_cam;
  nerf::Retime(fitted, kFrames, &path);
  return path;
}

double LargestInMedians(const CameraPath& path) {
  const std::vector<double> steps = nerf::StepsOf(path);
  return *std::max_element(steps.begin(), steps.end()) / io::Median(steps);
}

// The cameras come close on one side, the elevations of the pictures differ, and many stand close together.
TEST(EvenPath, EveryKindMovesEvenly) {
  std::vector<io::Rigid3d> ring, arc, wall, street;
  for (int i = 0; i < 40; ++i) {
    const double share = i / 40.0;
    ring.push_back(Around(360 * share * share, 20 + 15 * std::sin(i), 4 + 2 * std::cos(2 * pi * share)));
    arc.push_back(Around(200 * share, 20 + 15 * std::sin(i), i < 20 ? 2.5 : 5));
    wall.push_back(Ahead({0.1 * (i % 8), -4, 0.1 * (i / 8)}, Vector3d::UnitY()));
    street.push_back(Ahead({0.1 * std::sin(i), 0.4 * i + 3 * (i > 20), 0}, {0.1 * std::cos(i), 1, 0}));
  }
  const std::vector<std::pair<PathKind, std::vector<io::Rigid3d>>> captures = {
      {PathKind::kOrbit, ring}, {PathKind::kArc, arc}, {PathKind::kSway, wall}, {PathKind::kWalk, street}};
  for (const auto& [kind, poses] : captures) {
    const CameraPath path = FilmOf(poses);
    EXPECT_EQ(path.kind, kind);
    ASSERT_EQ(path.world_from_cam.size(), static_cast<std::size_t>(kFrames));
    EXPECT_LT(LargestInMedians(path), 2) << static_cast<int>(kind);
    EXPECT_TRUE(nerf::JumpsAmong(nerf::StepsOf(path)).empty());
  }
}

// Two rings of cameras: halfway between them nobody stood.
TEST(EvenPath, AnOrbitKeepsToOneRing) {
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 20; ++i) {
    poses.push_back(Around(18 * i, 5, 4));
    poses.push_back(Around(18 * i + 9, 65, 4));
    if (i % 2 == 0) poses.push_back(Around(18 * i + 5, 5, 4));
  }
  const CameraPath path = FilmOf(poses);
  EXPECT_EQ(path.kind, PathKind::kOrbit);
  for (const io::Rigid3d& pose : path.world_from_cam)
    EXPECT_NEAR(std::asin(pose.translation.z() / pose.translation.norm()) * 180 / pi, 5, 2);
}

// Poses that stand at the nearest of a few places and leap from one to the next, half way round.
CameraPath Leaping(std::vector<io::Rigid3d>* fitted) {
  CameraPath path;
  path.kind = PathKind::kOrbit;
  path.capture.depth = 4;
  for (int i = 0; i < 360; ++i) {
    fitted->push_back(Around(i, 20, 4));
    path.world_from_cam.push_back(i < 180 ? Around(36 * std::lround(i / 36.0), 20, 4) : fitted->back());
  }
  return path;
}

TEST(EvenPath, LeapsAreTimedAnew) {
  std::vector<io::Rigid3d> fitted;
  CameraPath path = Leaping(&fitted);
  EXPECT_FALSE(nerf::JumpsAmong(nerf::StepsOf(path)).empty());
  nerf::Retime(fitted, kFrames, &path);
  EXPECT_LT(LargestInMedians(path), 1.2);
  EXPECT_NEAR((path.world_from_cam[0].translation - fitted[0].translation).norm(), 0, 1e-9);
}

TEST(EvenPath, AFasterPartOfTheFittedPathIsSlower) {
  CameraPath path;
  path.kind = PathKind::kWalk;
  path.capture.depth = 4;
  for (int i = 0; i < 360; ++i)
    path.world_from_cam.push_back(Around(i < 240 ? 0.5 * i : 120 + 2 * (i - 240), 20, 4));
  EXPECT_NEAR(LargestInMedians(path), 4, 0.01);
  const std::vector<io::Rigid3d> fitted = path.world_from_cam;
  nerf::Retime(fitted, kFrames, &path);
  EXPECT_LT(LargestInMedians(path), 2);
}

TEST(EvenPath, AnEvenPathStaysAsItIs) {
  std::vector<io::Rigid3d> fitted;
  CameraPath path = Leaping(&fitted);
  path.world_from_cam = fitted;
  nerf::Retime(fitted, kFrames, &path);
  for (std::size_t i = 0; i < path.world_from_cam.size(); ++i)
    EXPECT_NEAR((path.world_from_cam[i].translation - fitted[4 * i].translation).norm(), 0, 1e-6);
}

// What is near moves faster in the picture.
TEST(EvenPath, IsSlowerBeforeNearThings) {
  CameraPath path;
  path.kind = PathKind::kWalk;
  path.capture.depth = 4;
  for (int i = 0; i <= 400; ++i) {
    path.world_from_cam.push_back(Ahead({0.01 * i, 0, 0}, Vector3d::UnitY()));
    path.depths.push_back(i < 200 ? 4 : 1);
  }
  const std::vector<io::Rigid3d> fitted = path.world_from_cam;
  EXPECT_NEAR(nerf::StepsOf(path)[0], 0.0025, 1e-9);
  EXPECT_NEAR(nerf::StepsOf(path)[300], 0.01, 1e-9);
  nerf::Retime(fitted, kFrames, &path);
  EXPECT_LT(LargestInMedians(path), 1.5);
  EXPECT_NEAR(path.world_from_cam.back().translation.x(), 4, 1e-9);
  EXPECT_LT(path.world_from_cam[kFrames / 2].translation.x(), 2.8);
}

TEST(EvenPath, OnlyJumpsAreJumps) {
  std::vector<double> steps(100);
  for (std::size_t i = 0; i < 100; ++i) steps[i] = 1 + 0.9 * std::sin(0.1 * static_cast<double>(i));
  for (std::size_t i = 60; i < 100; ++i) steps[i] = 5;  // a faster part, not a jump, once it is under way
  EXPECT_TRUE(nerf::JumpsAmong({steps.begin(), steps.begin() + 60}).empty());
  EXPECT_TRUE(nerf::JumpsAmong({steps.begin() + 60, steps.end()}).empty());
  steps.resize(60);
  steps[30] = 6;
  EXPECT_EQ(nerf::JumpsAmong(steps), std::vector<int>{30});
  EXPECT_TRUE(nerf::JumpsAmong({}).empty());
}

}  // namespace
