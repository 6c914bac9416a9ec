// The film's path stays where cameras were: rings, arcs, hemispheres and awkward captures.
#include "nerf/rendering/camera_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "io/base/error.h"
#include "tests/support/look_at.h"

namespace {

using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

Vector3d OnSphere(double azimuth_deg, double elevation_deg, double distance) {
  const double a = azimuth_deg * kPi / 180, e = elevation_deg * kPi / 180;
  return distance * Vector3d(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
}

io::Scene MakeScene(const std::vector<io::Rigid3d>& poses) {
  io::Scene scene;
  scene.cameras.resize(1);
  for (const io::Rigid3d& pose : poses) scene.frames.push_back({"", 0, pose});
  return scene;
}

// A hand-held orbit: `n` cameras from azimuth `from` to `to`, unsteady in elevation, distance and aim.
io::Scene HandHeld(int n, double from, double to, const Vector3d& target, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-1, 1);
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < n; ++i) {
    const double azimuth = from + (to - from) * i / n;
    const Vector3d centre = target + OnSphere(azimuth, 25 + 5 * jitter(random), 4 + 0.4 * jitter(random));
    const Vector3d aim = target + 0.1 * Vector3d(jitter(random), jitter(random), jitter(random));
    poses.push_back(LookAt(centre, aim, Vector3d::UnitZ()));
  }
  return MakeScene(poses);
}

double NearestCamera(const io::Scene& scene, const Vector3d& centre) {
  double nearest = 1e9;
  for (const io::Frame& frame : scene.frames) {
    nearest = std::min(nearest, (frame.world_from_cam.translation - centre).norm());
  }
  return nearest;
}

// The largest step between neighbouring poses, the wrap-around included.
double LargestStep(const nerf::CameraPath& path) {
  double largest = 0;
  for (std::size_t i = 0; i < path.world_from_cam.size(); ++i) {
    const auto& next = path.world_from_cam[(i + 1) % path.world_from_cam.size()];
    largest = std::max(largest, (next.translation - path.world_from_cam[i].translation).norm());
  }
  return largest;
}

void ExpectCamerasLookAtFocusUpright(const nerf::CameraPath& path) {
  for (const io::Rigid3d& pose : path.world_from_cam) {
    EXPECT_NEAR((pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
    EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-12);
    EXPECT_NEAR((path.focus - pose.translation).normalized().dot(-pose.rotation.col(2)), 1, 1e-12);
    EXPECT_NEAR(pose.rotation.col(0).dot(path.up), 0, 1e-12);  // the horizon is level
    EXPECT_GT(pose.rotation.col(1).dot(path.up), 0);
  }
}

TEST(FitOrbit, ExactRingIsReproduced) {
  std::vector<io::Rigid3d> poses;
  const Vector3d target(1, -2, 0.5);
  for (int i = 0; i < 40; ++i)
    poses.push_back(LookAt(target + OnSphere(9 * i, 30, 4), target, Vector3d::UnitZ()));
  const nerf::CameraPath path = nerf::FitOrbit(MakeScene(poses), 120);
  ASSERT_EQ(path.world_from_cam.size(), 120u);
  EXPECT_TRUE(path.closed);
  EXPECT_NEAR((path.focus - target).norm(), 0, 1e-9);
  EXPECT_NEAR(path.up.z(), 1, 1e-12);
  EXPECT_NEAR(path.distance, 4, 1e-9);
  for (const io::Rigid3d& pose : path.world_from_cam) {
    EXPECT_NEAR((pose.translation - target).norm(), 4, 1e-9);
    EXPECT_NEAR(pose.translation.z() - target.z(), 2, 1e-9);
  }
  // Each third pose stands on a camera: 40 cameras, 120 frames, starting at the first camera.
  for (int i = 0; i < 120; i += 3) {
    EXPECT_NEAR(NearestCamera(MakeScene(poses), path.world_from_cam[i].translation), 0, 1e-9);
  }
  ExpectCamerasLookAtFocusUpright(path);
}

TEST(FitOrbit, HandHeldOrbitIsSmoothAndStaysWhereCamerasWere) {
  const Vector3d target(0.2, 0.1, 0);
  const io::Scene scene = HandHeld(60, 0, 360, target);
  const nerf::CameraPath path = nerf::FitOrbit(scene, 120);
  EXPECT_TRUE(path.closed);
  EXPECT_LT((path.focus - target).norm(), 0.1);
  EXPECT_GT(path.up.z(), 0.999);
  for (const io::Rigid3d& pose : path.world_from_cam) {
    const Vector3d offset = pose.translation - target;
    EXPECT_GT(offset.norm(), 3.5);
    EXPECT_LT(offset.norm(), 4.5);
    EXPECT_LT(NearestCamera(scene, pose.translation), 0.7);
  }
  EXPECT_LT(LargestStep(path), 1.3 * 2 * kPi * 4 * std::cos(25 * kPi / 180) / 120);
  ExpectCamerasLookAtFocusUpright(path);
}

TEST(FitOrbit, ArcSwingsInsideTheCoveredSide) {
  const io::Scene scene = HandHeld(30, -60, 60, Vector3d::Zero());
  const nerf::CameraPath path = nerf::FitOrbit(scene, 90);
  EXPECT_FALSE(path.closed);
  EXPECT_NEAR(path.arc_deg, 116, 3);
  double least = 1e9, most = -1e9;
  for (const io::Rigid3d& pose : path.world_from_cam) {
    const double azimuth = std::atan2(pose.translation.y(), pose.translation.x()) * 180 / kPi;
    least = std::min(least, azimuth);
    most = std::max(most, azimuth);
    EXPECT_LT(NearestCamera(scene, pose.translation), 0.7);
  }
  EXPECT_GT(least, -63);
  EXPECT_LT(most, 59);
  EXPECT_GT(most - least, 100);
  EXPECT_LT(LargestStep(path), 0.4);  // no jump where the swing closes
  ExpectCamerasLookAtFocusUpright(path);
}

TEST(FitOrbit, CamerasOnAHemisphereKeepTheirDistance) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> azimuth(-180, 180), elevation(5, 80);
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 100; ++i) {
    poses.push_back(
        LookAt(OnSphere(azimuth(random), elevation(random), 4.03), Vector3d::Zero(), Vector3d::UnitZ()));
  }
  const nerf::CameraPath path = nerf::FitOrbit(MakeScene(poses), 60);
  EXPECT_TRUE(path.closed);
  for (const io::Rigid3d& pose : path.world_from_cam) EXPECT_NEAR(pose.translation.norm(), 4.03, 1e-6);
  ExpectCamerasLookAtFocusUpright(path);
}

TEST(FitOrbit, UpIsThePhotographersOnATiltedWorld) {
  io::Scene scene = HandHeld(40, 0, 150, Vector3d::Zero());
  const io::Sim3d tilt{
      1, Eigen::AngleAxisd(1.1, Vector3d(1, 2, 0).normalized()).toRotationMatrix(), {3, 1, -2}};
  for (io::Frame& frame : scene.frames) frame.world_from_cam = io::TransformPose(tilt, frame.world_from_cam);
  const nerf::CameraPath path = nerf::FitOrbit(scene, 30);
  EXPECT_GT(path.up.dot(tilt.rotation.col(2)), 0.999);
  EXPECT_LT((path.focus - tilt.translation).norm(), 0.15);
}

TEST(FitOrbit, ParallelCamerasLookIntoTheDepthRange) {
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 12; ++i) {
    const Vector3d centre(0.1 * (i % 4), -4, 0.1 * (i / 4));
    poses.push_back(LookAt(centre, centre + Vector3d::UnitY(), Vector3d::UnitZ()));
  }
  const nerf::CameraPath path = nerf::FitOrbit(MakeScene(poses), 24);
  EXPECT_FALSE(path.closed);
  EXPECT_NEAR(path.focus.y(), 0, 1e-9);  // 4 = middle of [2, 6] in front of the cameras
  for (const io::Rigid3d& pose : path.world_from_cam) {
    EXPECT_LT(NearestCamera(MakeScene(poses), pose.translation), 0.12);
  }
  EXPECT_GT(LargestStep(path), 1e-3);  // it does move
}

TEST(FitOrbit, CapturesWithoutAPathAreRefused) {
  EXPECT_THROW(nerf::FitOrbit(io::Scene(), 10), io::Error);
  std::vector<io::Rigid3d> rotation_only;
  for (int i = 0; i < 8; ++i) {
    rotation_only.push_back(LookAt({1, 1, 1}, Vector3d(1, 1, 1) + OnSphere(5 * i, 0, 1), Vector3d::UnitZ()));
  }
  EXPECT_THROW(nerf::FitOrbit(MakeScene(rotation_only), 10), io::Error);
}

}  // namespace
