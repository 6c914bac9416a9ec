// The path is drawn away from what stands before the camera and from what was never observed.
#include "nerf/paths/free_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/base/median.h"
#include "nerf/paths/even_path.h"
#include "tests/support/scenes/look_at.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

using Eigen::Vector3d;

// The sphere, and a board across the line of sight of cameras that stand between x = 0.5 and x = 1.5.
class BoardField : public tests::SphereField {
 public:
  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& pose,
                            const nerf::RenderOptions& options) const override {
    nerf::RenderedView view = SphereField::Render(camera, pose, options);
    if (std::abs(pose.translation.x() - 1) > 0.5 || pose.translation.z() < 0.5) return view;
    std::fill(view.depth.begin(), view.depth.end(), 0.1f);
    std::fill(view.opacity.begin(), view.opacity.end(), 1.f);
    return view;
  }
};

// The sphere, and splats in the same place as the board.
class VeiledField : public tests::SphereField {
 public:
  std::vector<float> NearSplatOpacity(const io::Camera& camera,
                                      const io::Rigid3d& pose,
                                      double distance,
                                      int /*threads*/) const override {
    const bool is_free = std::abs(pose.translation.x() - 1) > 0.5 || pose.translation.z() < 0.5;
    EXPECT_TRUE(distance > 0 && distance < 4);
    if (is_free) return {};
    return std::vector<float>(static_cast<std::size_t>(camera.width * camera.height), 0.7f);
  }
};

// Cameras side by side at y = -4, z = 0; the path goes past them at height `z`.
struct Capture {
  explicit Capture(double z) {
    train = tests::RingScene(1, 60, 45, [](int) { return ""; });
    train.frames.clear();
    for (int i = 0; i <= 20; ++i) train.frames.push_back({"", 0, Facing(0.1 * i, 0), {}});
    path.kind = nerf::PathKind::kWalk;
    path.capture = nerf::MeasureCapture(train);
    for (int i = 0; i < 60; ++i) path.world_from_cam.push_back(Facing(2.0 * i / 59, z));
  }
  static io::Rigid3d Facing(double x, double z) { return LookAt({x, -4, z}, {x, 0, z}, Vector3d::UnitZ()); }
  io::Scene train;
  nerf::CameraPath path;
};

TEST(FreePath, StaysWhereNothingIsInTheWay) {
  Capture capture(0.3);
  const tests::SphereField field;
  const std::vector<io::Rigid3d> before = capture.path.world_from_cam;
  const nerf::SupportMap support(field, capture.train, 1);
  const nerf::FreePathReport report = nerf::KeepFree(field, capture.train, support, 1, &capture.path);
  EXPECT_EQ(report.checked, 60);
  EXPECT_EQ(report.obstructed, 0);
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_EQ(capture.path.world_from_cam[i].translation, before[i].translation);
}

template <typename Field>
class ObstructedPath : public testing::Test {};
using Obstructing = testing::Types<BoardField, VeiledField>;
TYPED_TEST_SUITE(ObstructedPath, Obstructing);

TYPED_TEST(ObstructedPath, IsDrawnToTheCamerasWhereSomethingStandsBeforeIt) {
  Capture capture(0.8);
  const TypeParam field;
  const nerf::SupportMap support(field, capture.train, 1);
  const nerf::FreePathReport report = nerf::KeepFree(field, capture.train, support, 2, &capture.path);
  EXPECT_GT(report.obstructed, 20);
  EXPECT_EQ(report.remaining, 0);
  const std::vector<io::Rigid3d>& poses = capture.path.world_from_cam;
  EXPECT_LT(poses[30].translation.z(), 0.5);
  EXPECT_GT(poses[0].translation.z(), 0.75);
  double largest_step = 0;
  for (std::size_t i = 1; i < poses.size(); ++i)
    largest_step = std::max(largest_step, (poses[i].translation - poses[i - 1].translation).norm());
  EXPECT_LT(largest_step, 0.15);  // of 0.034 along the path
}

// Cameras in three groups: each pose has its nearest group ahead of or behind it. The path goes on at its own
// pace, and does not halt at a group and leap to the next one.
TEST(FreePath, IsDrawnToTheCamerasEvenlyWhereTheyStandInGroups) {
  Capture capture(0.8);
  capture.train.frames.clear();
  for (const double group : {0.2, 1.0, 1.8}) {
    for (int i = 0; i < 6; ++i)
      capture.train.frames.push_back({"", 0, Capture::Facing(group + 0.01 * i, 0.01 * (i % 2)), {}});
  }
  const std::vector<io::Rigid3d> fitted = capture.path.world_from_cam;
  const BoardField field;
  const nerf::SupportMap support(field, capture.train, 1);
  const nerf::FreePathReport report = nerf::KeepFree(field, capture.train, support, 1, &capture.path);
  EXPECT_GT(report.obstructed, 20);
  EXPECT_EQ(report.remaining, 0);
  const std::vector<io::Rigid3d>& poses = capture.path.world_from_cam;
  for (std::size_t i = 1; i < poses.size(); ++i)
    EXPECT_LT(poses[i].translation.x() - poses[i - 1].translation.x(), 0.1) << i;  // of 0.034 along the path
  ASSERT_EQ(capture.path.depths.size(), poses.size());
  for (const double depth : capture.path.depths) EXPECT_TRUE(depth > 1 && depth < 7) << depth;
  nerf::Retime(fitted, 60, &capture.path);
  const std::vector<double> steps = nerf::StepsOf(capture.path);
  EXPECT_LT(*std::max_element(steps.begin(), steps.end()), 2 * io::Median(steps));
}

// A wall behind whose edges nothing is known.
class WallField : public tests::SphereField {
 public:
  bool HasUnknownSpace() const override { return true; }
  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& pose,
                            const nerf::RenderOptions& options) const override {
    nerf::RenderedView view = SphereField::Render(camera, pose, options);
    std::fill(view.depth.begin(), view.depth.end(), 4.f);
    std::fill(view.opacity.begin(), view.opacity.end(), options.limits.end < 4 ? 0.f : 1.f);
    return view;
  }
};

// The path leans to one side: corners above and below what the upright cameras observed would be dark.
TEST(FreePath, IsDrawnToTheCamerasFromDarkCorners) {
  Capture capture(0);
  for (io::Rigid3d& pose : capture.path.world_from_cam)
    pose.rotation = pose.rotation * Eigen::AngleAxisd(0.1, Vector3d::UnitZ());
  const WallField field;
  const nerf::SupportMap support(field, capture.train, 1);
  const io::Camera camera = nerf::SmallCamera(capture.train.cameras[0], 32);
  const auto unobserved = [&](int i) {
    const io::Rigid3d& pose = capture.path.world_from_cam[static_cast<std::size_t>(i)];
    return support.ObservedIn(camera, pose, field.Render(camera, pose, {}), 1).UnobservedShare();
  };
  const double before = unobserved(30);
  EXPECT_GT(before, 0.01);
  EXPECT_LT(before, 0.032);
  const nerf::FreePathReport report = nerf::KeepFree(field, capture.train, support, 1, &capture.path);
  EXPECT_GT(report.obstructed, 20);
  EXPECT_EQ(report.remaining, 0);
  EXPECT_LT(unobserved(30), 0.005);
}

TEST(FreePath, DepthsAreFiniteBeforeAnEmptySky) {
  class Sky : public tests::SphereField {
   public:
    nerf::RenderedView Render(const io::Camera& camera,
                              const io::Rigid3d& pose,
                              const nerf::RenderOptions& options) const override {
      nerf::RenderedView view = SphereField::Render(camera, pose, options);
      std::fill(view.depth.begin(), view.depth.end(), std::numeric_limits<float>::infinity());
      return view;
    }
  };
  Capture capture(0.3);
  const Sky field;
  const nerf::SupportMap support(field, capture.train, 1);
  nerf::KeepFree(field, capture.train, support, 1, &capture.path);
  ASSERT_EQ(capture.path.depths.size(), capture.path.world_from_cam.size());
  for (const double depth : capture.path.depths) ASSERT_TRUE(std::isfinite(depth)) << depth;
}

// The view is free at the cameras alone, which stand in groups close together: every pose would see more from
// its nearest group, and hardly one where it would be drawn in the mean.
TEST(FreePath, StaysOnItsWayWhereDrawingItDoesNotHelp) {
  constexpr double kApart = 0.14, kFirst = 0.05;
  class Fog : public tests::SphereField {
   public:
    nerf::RenderedView Render(const io::Camera& camera,
                              const io::Rigid3d& pose,
                              const nerf::RenderOptions& options) const override {
      nerf::RenderedView view = SphereField::Render(camera, pose, options);
      const Vector3d& place = pose.translation;
      const bool at_group = std::abs(std::remainder(place.x() - kFirst, kApart)) < 3e-4 && place.z() < 0.1;
      if (!at_group) std::fill(view.opacity.begin(), view.opacity.end(), 1.f);
      return view;
    }
  };
  Capture capture(0.8);
  capture.train.frames.clear();
  for (int i = 0; i < 60; ++i)
    capture.train.frames.push_back(
        {"", 0, Capture::Facing(kFirst + kApart * (i / 4) + 5e-5 * (i % 4), 0), {}});
  capture.path.capture = nerf::MeasureCapture(capture.train);
  const Fog field;
  const nerf::SupportMap support(field, capture.train, 1);
  const nerf::FreePathReport report = nerf::KeepFree(field, capture.train, support, 1, &capture.path);
  EXPECT_EQ(report.obstructed, 60);
  // Some stand before a group, are drawn, and their neighbours with them; the others stay.
  EXPECT_GE(report.remaining, 55);
  EXPECT_GT(std::count_if(capture.path.world_from_cam.begin(),
                          capture.path.world_from_cam.end(),
                          [](const io::Rigid3d& pose) { return pose.translation.z() == 0.8; }),
            10);
}

}  // namespace
