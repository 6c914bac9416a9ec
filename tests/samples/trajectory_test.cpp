// Where the photographer stands: what makes an orbit reconstructible and a rotation not.
#include "samples/trajectory.h"

#include <gtest/gtest.h>

#include "io/scene/scene.h"

namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

double AngleBetweenCentres(const io::Rigid3d& a, const io::Rigid3d& b) {
  const Eigen::Vector3d aim(0, 0, 0.42);
  return std::acos((a.translation - aim).normalized().dot((b.translation - aim).normalized()));
}

TEST(Trajectory, OrbitGoesAllAroundInStepsThatSiftCanMatch) {
  for (const int count : {24, 40, 60}) {
    const std::vector<io::Rigid3d> poses = samples::OrbitPoses(count, 1);
    ASSERT_EQ(static_cast<int>(poses.size()), count);
    double around = 0;
    for (std::size_t i = 1; i < poses.size(); ++i) {
      EXPECT_LT(AngleBetweenCentres(poses[i - 1], poses[i]), 25 * kDegree)
          << count << " photographs, step " << i;
      around += AngleBetweenCentres(poses[i - 1], poses[i]);
    }
    EXPECT_GT(around, 250 * kDegree);
  }
}

TEST(Trajectory, EveryOrbitViewShowsTheFigurine) {
  const io::Camera camera{.width = 960, .height = 720, .fl_x = 816, .fl_y = 816, .cx = 480, .cy = 360};
  for (const io::Rigid3d& pose : samples::OrbitPoses(60, 7)) {
    EXPECT_NEAR((pose.rotation.transpose() * pose.rotation - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
    EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-12);
    for (const double z : {0.0, 1.28}) {
      const auto xy = io::ImgFromCam(camera, pose.Inverse() * Eigen::Vector3d(0, 0, z));
      ASSERT_TRUE(xy.has_value());
      EXPECT_TRUE(xy->x() > 0 && xy->x() < 960 && xy->y() > 0 && xy->y() < 720) << xy->transpose();
    }
    EXPECT_GT(pose.rotation(2, 1), 0.3);  // up in the picture is up in the world
  }
}

TEST(Trajectory, RotationHasNoBaselineAndForwardLooksWhereItGoes) {
  const std::vector<io::Rigid3d> turning = samples::RotationPoses(20, 1),
                                 walking = samples::ForwardPoses(20, 1);
  for (std::size_t i = 1; i < turning.size(); ++i) {
    EXPECT_EQ(turning[i].translation, turning[0].translation);
    EXPECT_GT((turning[i].rotation - turning[i - 1].rotation).norm(), 2 * kDegree);
    const Eigen::Vector3d step = (walking[i].translation - walking[i - 1].translation).normalized();
    EXPECT_GT(step.dot(-walking[i].rotation.col(2)), std::cos(2 * kDegree));
  }
}

TEST(Trajectory, WalkIsSmoothAndOnceAround) {
  double around = 0, largest = 0;
  for (int i = 1; i <= 360; ++i) {
    const double step =
        AngleBetweenCentres(samples::WalkPose((i - 1) / 30.0, 12, 1), samples::WalkPose(i / 30.0, 12, 1));
    around += step;
    largest = std::max(largest, step);
  }
  EXPECT_GT(around, 270 * kDegree);
  EXPECT_LT(largest, 2 * kDegree);
}

TEST(Trajectory, KnockTurnsTheViewAndKeepsTheCentre) {
  const io::Rigid3d pose = samples::WalkPose(1, 12, 1), knocked = samples::KnockedPose(pose, 0.03);
  EXPECT_EQ(knocked.translation, pose.translation);
  EXPECT_NEAR(std::acos(knocked.rotation.col(2).dot(pose.rotation.col(2))), 0.03, 1e-9);
}

TEST(Trajectory, SeedsDifferAndRepeat) {
  EXPECT_EQ(samples::OrbitPoses(20, 1)[5].translation, samples::OrbitPoses(20, 1)[5].translation);
  EXPECT_NE(samples::OrbitPoses(20, 1)[5].translation, samples::OrbitPoses(20, 2)[5].translation);
}

}  // namespace
