// Points find back to where the cameras see them, and nothing else moves.
#include "sfm/bundle/point_adjustment.h"

#include <gtest/gtest.h>

#include "sfm/bundle/bundle_adjustment.h"
#include "sfm/bundle/camera_models.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

TEST(PointAdjustment, PointsGoWhereTheCamerasSeeThem) {
  const io::ColmapModel truth = RingModel(8, 600, DistortedCamera(), 0, 3);
  io::ColmapModel model = truth;
  std::mt19937_64 random(1);
  for (io::Point3D& point : model.scene.points) point.xyz += RandomVector(&random, 0.1);
  ASSERT_TRUE(sfm::AdjustPoints(&model, 2));
  for (std::size_t i = 0; i < truth.scene.points.size(); ++i)
    EXPECT_LT((model.scene.points[i].xyz - truth.scene.points[i].xyz).norm(), 1e-7) << i;
  for (std::size_t i = 0; i < truth.scene.frames.size(); ++i) {
    EXPECT_EQ(model.scene.frames[i].world_from_cam.translation,
              truth.scene.frames[i].world_from_cam.translation);
    EXPECT_EQ(model.scene.frames[i].world_from_cam.rotation, truth.scene.frames[i].world_from_cam.rotation);
  }
  EXPECT_EQ(model.scene.cameras, truth.scene.cameras);
}

// At the minimum over cameras and points, no point can be moved for the better.
TEST(PointAdjustment, TheMinimumOfTheWholeIsOneOfEachPoint) {
  io::ColmapModel model = RingModel(8, 200, SmallCamera(), 0.5, 3);
  sfm::AdjustBundle(&model,
                    {.free = {sfm::FreeParametersOf("SIMPLE_PINHOLE")},
                     .max_iterations = 200,
                     .function_tolerance = 1e-14});
  const std::vector<io::Point3D> before = model.scene.points;
  ASSERT_TRUE(sfm::AdjustPoints(&model, 1));
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_LT((model.scene.points[i].xyz - before[i].xyz).norm(), 1e-5) << i;
}

TEST(PointAdjustment, TheNumberOfThreadsChangesNoBit) {
  io::ColmapModel one = RingModel(8, 600, SmallCamera(), 0.5, 3);
  io::ColmapModel three = one;
  ASSERT_TRUE(sfm::AdjustPoints(&one, 1));
  ASSERT_TRUE(sfm::AdjustPoints(&three, 3));
  for (std::size_t i = 0; i < one.scene.points.size(); ++i)
    EXPECT_EQ(one.scene.points[i].xyz, three.scene.points[i].xyz) << i;
}

TEST(PointAdjustment, APointBehindACameraIsTold) {
  io::ColmapModel model = RingModel(8, 20, SmallCamera(), 0, 3);
  io::Rigid3d& pose = model.scene.frames[2].world_from_cam;
  pose = io::FlipCameraAxes(pose);  // looks the other way
  pose.translation *= 2;
  EXPECT_FALSE(sfm::AdjustPoints(&model, 1));
}

}  // namespace
