#include "nerf/paths/keyframe_path.h"

#include <gtest/gtest.h>

#include <numbers>

namespace nerf {
namespace {

Keyframe At(double x, double angle, double fov) {
  Keyframe key;
  key.world_from_cam.translation = {x, 2 * x, 1};
  key.world_from_cam.rotation =
      Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 2).normalized()).toRotationMatrix();
  key.fov_y = fov;
  return key;
}

void ExpectNear(const Keyframe& a, const Keyframe& b) {
  EXPECT_LT((a.world_from_cam.translation - b.world_from_cam.translation).norm(), 1e-12);
  EXPECT_LT((a.world_from_cam.rotation - b.world_from_cam.rotation).norm(), 1e-12);
  EXPECT_NEAR(a.fov_y, b.fov_y, 1e-12);
}

const std::vector<Keyframe> kKeys = {At(0, 0, 0.8), At(1, 2.5, 0.9), At(3, 4.5, 0.7), At(2, 7, 0.8)};

TEST(KeyframePath, PassesThroughEveryKeyframeAtEqualTimes) {
  const std::vector<Keyframe> path = InterpolateKeyframes(kKeys, 31, false);
  ASSERT_EQ(path.size(), 31u);
  for (std::size_t k = 0; k < kKeys.size(); ++k) ExpectNear(path[10 * k], kKeys[k]);
}

TEST(KeyframePath, ALoopReturnsToItsBeginning) {
  const std::vector<Keyframe> path = InterpolateKeyframes(kKeys, 40, true);
  for (std::size_t k = 0; k < kKeys.size(); ++k) ExpectNear(path[10 * k], kKeys[k]);
  const auto step = [&](std::size_t i) {
    return (path[(i + 1) % 40].world_from_cam.translation - path[i].world_from_cam.translation).norm();
  };
  EXPECT_LT(step(39), 2 * step(38));  // no jump from the last frame to the first
}

TEST(KeyframePath, StaysRigidAndWithinTheAngles) {
  for (const Keyframe& frame : InterpolateKeyframes(kKeys, 100, true)) {
    const Eigen::Matrix3d& r = frame.world_from_cam.rotation;
    EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_GT(r.determinant(), 0);
    EXPECT_GE(frame.fov_y, 0.7);
    EXPECT_LE(frame.fov_y, 0.9);
  }
}

TEST(KeyframePath, OneKeyframeStands) {
  for (const bool is_loop : {false, true}) {
    for (const Keyframe& frame : InterpolateKeyframes({kKeys.data(), 1}, 3, is_loop))
      ExpectNear(frame, kKeys[0]);
  }
}

TEST(KeyframePath, CameraHasTheAngleOfView) {
  const io::Camera camera = CameraOfView(80, 60, std::numbers::pi / 2);
  EXPECT_DOUBLE_EQ(camera.fl_y, 30);
  const auto top = io::RayFromImg(camera, {40, 0}), bottom = io::RayFromImg(camera, {40, 60});
  EXPECT_NEAR(top->dot(*bottom), 0, 1e-12);
}

}  // namespace
}  // namespace nerf
