// A walk begins and ends where more than one picture shows what is there.
#include "nerf/paths/path_ends.h"

#include <gtest/gtest.h>

#include "tests/support/scenes/look_at.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

using Eigen::Vector3d;

// A wall at y = 0.
class EndlessWall : public tests::SphereField {
 public:
  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& pose,
                            const nerf::RenderOptions& options) const override {
    nerf::RenderedView view = SphereField::Render(camera, pose, options);
    for (int y = 0, i = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x, ++i) {
        const Vector3d ray = pose.rotation * *io::RayFromImg(camera, {x + 0.5, y + 0.5});
        view.depth[static_cast<std::size_t>(i)] = static_cast<float>(-pose.translation.y() / ray.y());
      }
    }
    return view;
  }
};

io::Rigid3d Facing(double x) { return LookAt({x, -1, 0}, {x, 0, 0}, Vector3d::UnitZ()); }

// Cameras that face the wall at these places, each of which sees 1 to both sides; a walk from the first to
// the last of them.
struct WallWalk {
  explicit WallWalk(const std::vector<double>& places) {
    train.cameras = {{.width = 64, .height = 48, .fl_x = 32, .fl_y = 32, .cx = 32, .cy = 24}};
    for (const double x : places) train.frames.push_back({"", 0, Facing(x), {}});
    path.kind = nerf::PathKind::kWalk;
    for (int i = 0; i < kPoses; ++i)
      path.world_from_cam.push_back(
          Facing(places.front() + (places.back() - places.front()) * i / (kPoses - 1)));
    path.depths.assign(kPoses, 1);
    fitted = path.world_from_cam;
  }
  nerf::CutEnds Cut() {
    const EndlessWall field;
    const nerf::SupportMap support(field, train, 1);
    return nerf::CutWeakEnds(field, train, support, 1, &fitted, &path);
  }
  double First() const { return path.world_from_cam.front().translation.x(); }
  double Last() const { return path.world_from_cam.back().translation.x(); }

  static constexpr int kPoses = 200;
  io::Scene train;
  nerf::CameraPath path;
  std::vector<io::Rigid3d> fitted;
};

std::vector<double> Row(double first, double last) {
  std::vector<double> places;
  for (double x = first; x <= last; x += 0.25) places.push_back(x);
  return places;
}

TEST(PathEnds, WhatOnePictureShowsIsCutOff) {
  std::vector<double> places = Row(0, 10);
  places.insert(places.begin(), -0.9);
  WallWalk start(places);
  const nerf::CutEnds ends = start.Cut();
  EXPECT_GT(ends.first, 0.04);
  EXPECT_GT(start.First(), -0.45);
  EXPECT_LE(start.First(), 0);
  // Beside the last camera lies what two cameras see: the slack leaves a twentieth.
  EXPECT_GT(start.Last(), 9.6);
  EXPECT_NEAR(static_cast<double>(start.path.world_from_cam.size()),
              (1 - ends.first - ends.last) * WallWalk::kPoses,
              1e-9);
  EXPECT_EQ(start.path.depths.size(), start.path.world_from_cam.size());
  ASSERT_EQ(start.fitted.size(), start.path.world_from_cam.size());
  EXPECT_EQ(start.fitted.front().translation, start.path.world_from_cam.front().translation);

  places = Row(0, 10);
  places.push_back(10.9);
  WallWalk end(places);
  EXPECT_GT(end.Cut().last, 0.04);
  EXPECT_LT(end.Last(), 10.45);
  EXPECT_GE(end.Last(), 9.9);
}

TEST(PathEnds, WalksThatAreSeenAllAlongStayWhole) {
  WallWalk walk(Row(0, 10));
  const nerf::CutEnds ends = walk.Cut();
  EXPECT_LE(ends.first, 0.04);
  EXPECT_LE(ends.last, 0.04);
  // Where each picture shows something else, no place is better than another.
  WallWalk sparse({0, 3, 6, 9, 12});
  EXPECT_EQ(sparse.Cut().first, 0);
  EXPECT_EQ(sparse.path.world_from_cam.size(), static_cast<std::size_t>(WallWalk::kPoses));
}

TEST(PathEnds, AnEndThatDoesNotGetBetterSoonStays) {
  std::vector<double> places = Row(0, 10);
  for (const double x : {-0.9, -2.8, -4.7}) places.insert(places.begin(), x);
  WallWalk walk(places);
  EXPECT_EQ(walk.Cut().first, 0);
}

TEST(PathEnds, OtherPathsHaveNoEnds) {
  std::vector<double> places = Row(0, 10);
  places.insert(places.begin(), -0.9);
  WallWalk arc(places);
  arc.path.kind = nerf::PathKind::kArc;
  const nerf::CutEnds ends = arc.Cut();
  EXPECT_EQ(ends.first + ends.last, 0);
}

}  // namespace
