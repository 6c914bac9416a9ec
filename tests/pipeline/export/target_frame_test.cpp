// The frames that exports are written in, and the unit that two points of known distance give.
#include "pipeline/export/target_frame.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace pipeline {
namespace {

io::Sim3d SomeSim3() {
  return {2.5, Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(), {1, -2, 3}};
}

TEST(TargetFrame, SceneIsTheSceneItself) {
  const TargetFrame target = MakeTargetFrame({}, SomeSim3());
  EXPECT_TRUE(target.IsScene());
  EXPECT_EQ(target.target_from_scene * Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(1, 2, 3));
}

TEST(TargetFrame, SfmLeadsBackToWhereThePosesCameFrom) {
  const TargetFrame target = MakeTargetFrame({.frame = "sfm"}, SomeSim3());
  EXPECT_FALSE(target.IsScene());
  const Eigen::Vector3d in_sfm(0.3, 4, -5);
  EXPECT_LT((target.target_from_scene * (SomeSim3() * in_sfm) - in_sfm).norm(), 1e-12);
}

TEST(TargetFrame, TwoPointsApartGiveMetresInTheirFrame) {
  const Eigen::Vector3d a(1, 2, 3), b(1, 2, 5);
  for (const char* frame : {"scene", "sfm"}) {
    const TargetFrame plain = MakeTargetFrame({.frame = frame}, SomeSim3());
    const TargetFrame metric =
        MakeTargetFrame({.frame = frame, .points_apart = "1,2,3,1,2,5=0.30"}, SomeSim3());
    EXPECT_EQ(metric.unit, "metre");
    EXPECT_FALSE(metric.IsScene());
    const io::Sim3d scene_from_plain = plain.target_from_scene.Inverse();
    const Eigen::Vector3d a_metric = metric.target_from_scene * (scene_from_plain * a),
                          b_metric = metric.target_from_scene * (scene_from_plain * b);
    EXPECT_NEAR((a_metric - b_metric).norm(), 0.3, 1e-12) << frame;
    EXPECT_LT((a_metric - 0.15 * a).norm(), 1e-12) << frame;  // about the frame's origin
  }
}

TEST(TargetFrame, OtherFormsOfPointsAreRefused) {
  for (const char* text : {"1,2,3,4,5,6",
                           "1,2,3,4,5=1",
                           "1,2,3,4,5,6,7=1",
                           "1,2,3,4,5,6=",
                           "1,2,3,4,5,6=1m",
                           "1,2,3,4,5,x=1",
                           "1,2,3,1,2,3=1",
                           "1,2,3,4,5,6=0",
                           "1,2,3,4,5,6=-1",
                           "1,2,3,4,5,nan=1",
                           "1,2,3,4,5,6=inf",
                           "1e10,2,3,4,5,6=1",
                           "1 ,2,3,4,5,6=1"})
    EXPECT_ERROR(ParsePointsApart("points-apart", text), io::ExitCode::kUsage, "--points-apart", text);
}

}  // namespace
}  // namespace pipeline
