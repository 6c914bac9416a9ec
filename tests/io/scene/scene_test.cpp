// The conventions of io/scene/scene.h and io/scene/pose.h.
#include "io/scene/scene.h"

#include <gtest/gtest.h>

namespace {

io::Camera BarrelCamera() {
  return {.width = 640,
          .height = 480,
          .fl_x = 500,
          .fl_y = 510,
          .cx = 321,
          .cy = 239,
          .k1 = -0.2,
          .k2 = 0.05,
          .p1 = 1e-3,
          .p2 = -2e-3};
}

TEST(Scene, PixelCentreOfThePrincipalPointLooksAlongMinusZ) {
  const io::Camera camera{.width = 5, .height = 5, .fl_x = 4, .fl_y = 4, .cx = 2.5, .cy = 2.5};
  const Eigen::Vector3d direction = io::RayFromImg(camera, {2 + 0.5, 2 + 0.5}).value();
  EXPECT_NEAR((direction - Eigen::Vector3d(0, 0, -1)).norm(), 0, 1e-15);
}

TEST(Scene, OpenGlAxesPutUpAtTheTopOfThePicture) {
  const io::Camera camera{.width = 4, .height = 4, .fl_x = 4, .fl_y = 4, .cx = 2, .cy = 2};
  const Eigen::Vector2d xy = io::ImgFromCam(camera, {0.1, 0.2, -1}).value();
  EXPECT_GT(xy.x(), 2);
  EXPECT_LT(xy.y(), 2);
  EXPECT_FALSE(io::ImgFromCam(camera, {0, 0, 1}).has_value());
}

TEST(Scene, ProjectionInvertsRaysToAMillionthOfAPixel) {
  const io::Camera camera = BarrelCamera();
  int cases = 0;
  for (double y = 0; y <= camera.height; y += 30) {
    for (double x = 0; x <= camera.width; x += 40, ++cases) {
      const auto ray = io::RayFromImg(camera, {x, y});
      ASSERT_TRUE(ray.has_value());
      EXPECT_NEAR(ray->norm(), 1, 1e-12);
      EXPECT_NEAR((*io::ImgFromCam(camera, *ray * 3.7) - Eigen::Vector2d(x, y)).norm(), 0, 1e-6);
    }
  }
  EXPECT_EQ(cases, 17 * 17);
}

TEST(Scene, NoRayWhereTheDistortionFoldsBack) {
  io::Camera camera = BarrelCamera();
  camera.k1 = -1.5;
  camera.k2 = 0;
  EXPECT_FALSE(io::RayFromImg(camera, {0, 0}).has_value());
}

TEST(Scene, ResizingScalesTheRayGridOnly) {
  const io::Camera camera = BarrelCamera();
  const io::Camera half = io::ResizedCamera(camera, 320, 240);
  EXPECT_NEAR((*io::RayFromImg(camera, {100, 50}) - *io::RayFromImg(half, {50, 25})).norm(), 0, 1e-12);
}

TEST(Pose, FlippingAxesTwiceIsTheIdentityAndKeepsTheCentre) {
  const io::Rigid3d pose{Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
                         {1, 2, 3}};
  const io::Rigid3d flipped = io::FlipCameraAxes(pose);
  EXPECT_NEAR((flipped * Eigen::Vector3d(0, 0, -1) - pose * Eigen::Vector3d(0, 0, 1)).norm(), 0, 1e-15);
  EXPECT_NEAR((flipped * Eigen::Vector3d(0, 1, 0) - pose * Eigen::Vector3d(0, -1, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((io::FlipCameraAxes(flipped).rotation - pose.rotation).norm(), 0, 1e-15);
  EXPECT_NEAR(flipped.rotation.determinant(), 1, 1e-12);
}

TEST(Pose, SimilarityTimesItsInverseIsTheIdentity) {
  const io::Sim3d b_from_a{
      1e-3, Eigen::AngleAxisd(2.1, Eigen::Vector3d(1, -1, 2).normalized()).toRotationMatrix(), {1e3, -5, 7}};
  const io::Sim3d identity = b_from_a.Inverse() * b_from_a;
  EXPECT_NEAR(identity.scale, 1, 1e-12);
  EXPECT_NEAR((identity.rotation - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
  EXPECT_NEAR((b_from_a.Inverse() * (b_from_a * Eigen::Vector3d(1, 2, 3)) - Eigen::Vector3d(1, 2, 3)).norm(),
              0,
              1e-9);
}

}  // namespace
