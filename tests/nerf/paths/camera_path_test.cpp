// The film's path follows the capture and stays where cameras were: rings, arcs, hemispheres, rooms, streets
// and awkward captures.
#include "nerf/paths/camera_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "io/base/error.h"
#include "tests/support/scenes/look_at.h"

namespace {

using Eigen::Vector3d;
using nerf::PathKind;
using std::numbers::pi;

Vector3d OnSphere(double azimuth_deg, double elevation_deg, double distance) {
  const double a = azimuth_deg * pi / 180, e = elevation_deg * pi / 180;
  return distance * Vector3d(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
}

io::Scene MakeScene(const std::vector<io::Rigid3d>& poses) {
  io::Scene scene;
  scene.cameras.push_back({.width = 80, .height = 60, .fl_x = 80, .fl_y = 80, .cx = 40, .cy = 30});
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

// aim: the largest sine of the angle by which the focus is missed.
void ExpectUprightTowardsFocus(const nerf::CameraPath& path, double aim) {
  const Vector3d &focus = path.capture.focus, &up = path.capture.up;
  for (const io::Rigid3d& pose : path.world_from_cam) {
    EXPECT_NEAR((pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
    EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-12);
    EXPECT_LE((focus - pose.translation).normalized().cross(pose.rotation.col(2)).norm(), aim);
    EXPECT_NEAR(pose.rotation.col(0).dot(up), 0, 1e-12);  // the horizon is level
    EXPECT_GT(pose.rotation.col(1).dot(up), 0);
  }
}

TEST(CameraPath, ExactRingIsReproduced) {
  std::vector<io::Rigid3d> poses;
  const Vector3d target(1, -2, 0.5);
  for (int i = 0; i < 40; ++i)
    poses.push_back(LookAt(target + OnSphere(9 * i, 30, 4), target, Vector3d::UnitZ()));
  const nerf::CameraPath path = nerf::FitCameraPath(MakeScene(poses), 120);
  ASSERT_EQ(path.world_from_cam.size(), 120u);
  EXPECT_EQ(path.kind, PathKind::kOrbit);
  EXPECT_NEAR((path.capture.focus - target).norm(), 0, 1e-9);
  EXPECT_NEAR(path.capture.up.z(), 1, 1e-12);
  EXPECT_NEAR(path.distance, 4, 1e-9);
  for (const io::Rigid3d& pose : path.world_from_cam) {
    EXPECT_NEAR((pose.translation - target).norm(), 4, 1e-9);
    EXPECT_NEAR(pose.translation.z() - target.z(), 2, 1e-9);
  }
  // Each third pose stands on a camera: 40 cameras, 120 frames, starting at the first camera.
  for (std::size_t i = 0; i < 120; i += 3) {
    EXPECT_NEAR(NearestCamera(MakeScene(poses), path.world_from_cam[i].translation), 0, 1e-9);
  }
  ExpectUprightTowardsFocus(path, 1e-7);
}

TEST(CameraPath, HandHeldOrbitIsSmoothAndStaysWhereCamerasWere) {
  const Vector3d target(0.2, 0.1, 0);
  const io::Scene scene = HandHeld(60, 0, 360, target);
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 120);
  EXPECT_EQ(path.kind, PathKind::kOrbit);
  EXPECT_LT((path.capture.focus - target).norm(), 0.1);
  EXPECT_GT(path.capture.up.z(), 0.999);
  for (const io::Rigid3d& pose : path.world_from_cam) {
    const Vector3d offset = pose.translation - target;
    EXPECT_GT(offset.norm(), 3.5);
    EXPECT_LT(offset.norm(), 4.5);
    EXPECT_LT(NearestCamera(scene, pose.translation), 0.7);
  }
  EXPECT_LT(LargestStep(path), 1.3 * 2 * pi * 4 * std::cos(25 * pi / 180) / 120);
  ExpectUprightTowardsFocus(path, 0.02);
}

TEST(CameraPath, ArcSwingsInsideTheCoveredSide) {
  const io::Scene scene = HandHeld(30, -60, 60, Vector3d::Zero());
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 90);
  EXPECT_EQ(path.kind, PathKind::kArc);
  EXPECT_NEAR(path.arc_deg, 108, 3);  // of 116: it ends between cameras
  double least = 1e9, most = -1e9;
  for (const io::Rigid3d& pose : path.world_from_cam) {
    const double azimuth = std::atan2(pose.translation.y(), pose.translation.x()) * 180 / pi;
    least = std::min(least, azimuth);
    most = std::max(most, azimuth);
    EXPECT_LT(NearestCamera(scene, pose.translation), 0.7);
  }
  EXPECT_GT(least, -59);
  EXPECT_LT(most, 55);
  EXPECT_GT(most - least, 100);
  EXPECT_LT(LargestStep(path), 0.4);  // no jump where the swing closes
  ExpectUprightTowardsFocus(path, 0.02);
}

// At one end of the arc the cameras came so near that they show a part of the subject.
TEST(CameraPath, AnArcEndsWhereItsSubjectNoLongerFits) {
  io::Scene scene = HandHeld(60, 0, 150, {0, 0, 0});
  for (const io::Frame& frame : HandHeld(20, 150, 190, {0, 0, 0}).frames) {
    io::Rigid3d near = frame.world_from_cam;
    near.translation *= 0.45;
    scene.frames.push_back({"", 0, near});
  }
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 120);
  EXPECT_EQ(path.kind, PathKind::kArc);
  EXPECT_NEAR(path.arc_deg, 172, 6);  // of 188, as far as the smoothing reaches
  for (const io::Rigid3d& pose : path.world_from_cam) EXPECT_GT(pose.translation.norm(), 2.8);
}

// A third of the pictures are close-ups of a part beside the middle: the film shows the whole subject.
TEST(CameraPath, CloseUpsDoNotDrawThePathAwayFromTheSubject) {
  io::Scene scene = HandHeld(60, 0, 360, Vector3d::Zero());
  for (int i = 0; i < 30; ++i) {
    const Vector3d part = OnSphere(12 * i, 0, 0.6);
    scene.frames.push_back({"", 0, LookAt(part + OnSphere(12 * i, 0, 0.9), part, Vector3d::UnitZ()), {}});
    scene.frames.back().world_from_cam.rotation =
        Eigen::AngleAxisd(0.3, Vector3d::UnitZ()) * scene.frames.back().world_from_cam.rotation;
  }
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 60);
  EXPECT_EQ(path.kind, PathKind::kOrbit);
  for (const io::Rigid3d& pose : path.world_from_cam) EXPECT_GT(pose.translation.norm(), 3.6);
  ExpectUprightTowardsFocus(path, 0.02);
}

TEST(CameraPath, CamerasOnAHemisphereKeepTheirDistance) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> azimuth(-180, 180), elevation(5, 80);
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 100; ++i) {
    poses.push_back(
        LookAt(OnSphere(azimuth(random), elevation(random), 4.03), Vector3d::Zero(), Vector3d::UnitZ()));
  }
  const nerf::CameraPath path = nerf::FitCameraPath(MakeScene(poses), 60);
  EXPECT_EQ(path.kind, PathKind::kOrbit);
  for (const io::Rigid3d& pose : path.world_from_cam) EXPECT_NEAR(pose.translation.norm(), 4.03, 1e-6);
  ExpectUprightTowardsFocus(path, 1e-7);
}

TEST(CameraPath, UpIsThePhotographersOnATiltedWorld) {
  io::Scene scene = HandHeld(40, 0, 150, Vector3d::Zero());
  const io::Sim3d tilt{
      1, Eigen::AngleAxisd(1.1, Vector3d(1, 2, 0).normalized()).toRotationMatrix(), {3, 1, -2}};
  for (io::Frame& frame : scene.frames) frame.world_from_cam = io::TransformPose(tilt, frame.world_from_cam);
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 30);
  EXPECT_GT(path.capture.up.dot(tilt.rotation.col(2)), 0.999);
  EXPECT_LT((path.capture.focus - tilt.translation).norm(), 0.15);
}

TEST(CameraPath, ParallelCamerasLookIntoTheDepthRange) {
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 12; ++i) {
    const Vector3d centre(0.1 * (i % 4), -4, 0.1 * (i / 4));
    poses.push_back(LookAt(centre, centre + Vector3d::UnitY(), Vector3d::UnitZ()));
  }
  const nerf::CameraPath path = nerf::FitCameraPath(MakeScene(poses), 24);
  EXPECT_EQ(path.kind, PathKind::kSway);
  EXPECT_NEAR(path.capture.focus.y(), 0, 1e-9);  // 4 = middle of [2, 6] in front of the cameras
  for (const io::Rigid3d& pose : path.world_from_cam) EXPECT_GT(-pose.rotation.col(2).y(), 0.9999);
  for (const io::Rigid3d& pose : path.world_from_cam) {
    EXPECT_LT(NearestCamera(MakeScene(poses), pose.translation), 0.12);
  }
  EXPECT_GT(LargestStep(path), 1e-3);  // it does move
}

// Steps from pose to pose as picture motion.
std::vector<double> Motions(const nerf::CameraPath& path) {
  std::vector<double> motions;
  for (std::size_t i = 1; i < path.world_from_cam.size(); ++i)
    motions.push_back(nerf::Motion(path.world_from_cam[i - 1], path.world_from_cam[i], path.capture.depth));
  return motions;
}

void ExpectEvenSpeedWithEase(const nerf::CameraPath& path) {
  const std::vector<double> motions = Motions(path);
  const std::size_t n = motions.size();
  const double middle = motions[n / 2];
  for (std::size_t i = n / 5; i < n - n / 5; ++i) EXPECT_NEAR(motions[i], middle, 0.15 * middle) << i;
  EXPECT_LT(motions.front(), 0.5 * middle);
  EXPECT_LT(motions.back(), 0.5 * middle);
}

// Around the corner of a corridor with an unsteady hand, looking ahead.
std::vector<io::Rigid3d> Corridor(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-0.05, 0.05);
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 40; ++i) {
    const double turn = std::clamp((i - 15) / 10.0, 0.0, 1.0) * pi / 2;
    const Vector3d ahead(std::cos(turn), std::sin(turn), 0);
    const Vector3d before = poses.empty() ? Vector3d::Zero() : poses.back().translation;
    const Vector3d place = before + 0.3 * ahead + Vector3d(jitter(random), jitter(random), jitter(random));
    poses.push_back(LookAt(place, place + ahead + Vector3d(0, 0, jitter(random)), Vector3d::UnitZ()));
  }
  return poses;
}

TEST(CameraPath, CorridorIsWalkedInTheOrderOfTheCapture) {
  const io::Scene scene = MakeScene(Corridor(1));
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 200);
  ASSERT_EQ(path.kind, PathKind::kWalk);
  ASSERT_EQ(path.world_from_cam.size(), 200u);
  EXPECT_FALSE(path.IsLoop());
  EXPECT_NEAR(
      (path.world_from_cam.front().translation - scene.frames.front().world_from_cam.translation).norm(),
      0,
      1e-9);
  EXPECT_NEAR(
      (path.world_from_cam.back().translation - scene.frames.back().world_from_cam.translation).norm(),
      0,
      1e-9);
  for (const io::Rigid3d& pose : path.world_from_cam) {
    EXPECT_LT(NearestCamera(scene, pose.translation), 0.3);
    EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-9);
  }
  EXPECT_LT(nerf::LargestDeparture(path, scene), 3 * path.capture.spacing);
  ExpectEvenSpeedWithEase(path);
}

// Those of one direction follow one another.
TEST(CameraPath, OfPanoramasTheFirstViewIsFollowed) {
  const std::vector<io::Rigid3d> ahead = Corridor(1);
  std::vector<io::Rigid3d> views;
  for (int side = 0; side < 6; ++side) {
    for (std::size_t i = 0; i < ahead.size(); ++i) {
      io::Rigid3d view = ahead[i];
      view.rotation = view.rotation * Eigen::AngleAxisd(-side * pi / 3, Vector3d::UnitY());
      views.push_back(view);
    }
  }
  const nerf::CameraPath path = nerf::FitCameraPath(MakeScene(views), 200);
  const nerf::CameraPath plain = nerf::FitCameraPath(MakeScene(ahead), 200);
  ASSERT_EQ(path.kind, plain.kind);
  for (std::size_t i = 0; i < 200; ++i) {
    EXPECT_LT((path.world_from_cam[i].translation - plain.world_from_cam[i].translation).norm(), 1e-9) << i;
    EXPECT_LT((path.world_from_cam[i].rotation - plain.world_from_cam[i].rotation).norm(), 1e-9) << i;
  }
}

TEST(CameraPath, ShuffledPicturesAreWalkedFromNeighbourToNeighbour) {
  std::vector<io::Rigid3d> poses = Corridor(2);
  const double in_order = nerf::TotalMotion(nerf::FitCameraPath(MakeScene(poses), 100));
  std::shuffle(poses.begin(), poses.end(), std::mt19937(3));
  const nerf::CameraPath path = nerf::FitCameraPath(MakeScene(poses), 100);
  EXPECT_EQ(path.kind, PathKind::kWalk);
  EXPECT_LT(nerf::TotalMotion(path), 1.3 * in_order);
  EXPECT_LT(nerf::LargestDeparture(path, MakeScene(poses)), 4 * path.capture.spacing);
}

// The walk stops, and goes on at its beginning: the film goes back the way the cameras came.
TEST(CameraPath, JumpIsMadeAlongTheCameras) {
  std::vector<io::Rigid3d> poses = Corridor(4);
  io::Rigid3d aside = poses.front();
  aside.translation += Vector3d(-0.2, 0.2, 0);
  poses.push_back(aside);
  const io::Scene scene = MakeScene(poses);
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 300);
  EXPECT_EQ(path.kind, PathKind::kWalk);
  for (const io::Rigid3d& pose : path.world_from_cam) EXPECT_LT(NearestCamera(scene, pose.translation), 0.4);
}

TEST(CameraPath, StreetIsWalkedForwards) {
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 30; ++i) {
    const Vector3d place(0.05 * std::sin(2.0 * i), 0.4 * i, 0);
    poses.push_back(LookAt(place, place + Vector3d(0.02 * std::cos(3.0 * i), 1, 0), Vector3d::UnitZ()));
  }
  const nerf::CameraPath path = nerf::FitCameraPath(MakeScene(poses), 90);
  EXPECT_EQ(path.kind, PathKind::kWalk);
  for (std::size_t i = 1; i < 90; ++i)
    EXPECT_GT(path.world_from_cam[i].translation.y(), path.world_from_cam[i - 1].translation.y());
  ExpectEvenSpeedWithEase(path);
}

// Along a street whose axes meet not far from the last cameras, which see that point from many sides.
TEST(CameraPath, StreetThatEndsAtAPointIsWalked) {
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 30; ++i) {
    const Vector3d place(0.2 * std::sin(0.2 * i), 0.4 * i, 0);
    poses.push_back(LookAt(place, Vector3d(1, 12.5, 0.1 * std::sin(i)), Vector3d::UnitZ()));
  }
  const nerf::CameraPath path = nerf::FitCameraPath(MakeScene(poses), 90);
  EXPECT_GE(path.capture.hit_share, 0.75);
  EXPECT_EQ(path.kind, PathKind::kWalk);
}

TEST(CameraPath, CamerasThatGoTowardsTheirSubjectAreWalked) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> jitter(-0.15, 0.15);
  std::vector<io::Rigid3d> poses;
  for (int i = 0; i < 20; ++i) {
    const Vector3d place(jitter(random), -6 + 0.25 * i, jitter(random));
    poses.push_back(LookAt(place, Vector3d::Zero(), Vector3d::UnitZ()));
  }
  EXPECT_EQ(nerf::FitCameraPath(MakeScene(poses), 60).kind, PathKind::kWalk);
}

TEST(CameraPath, PicturesOfSomethingElseDoNotShiftTheFocus) {
  io::Scene scene = HandHeld(40, 0, 360, Vector3d::Zero());
  for (int i = 0; i < 40; i += 8) {
    io::Rigid3d& pose = scene.frames[static_cast<std::size_t>(i)].world_from_cam;
    pose = LookAt(pose.translation, pose.translation + Vector3d(1, 0.2 * i, 0.5), Vector3d::UnitZ());
  }
  const nerf::CameraPath path = nerf::FitCameraPath(scene, 60);
  EXPECT_EQ(path.kind, PathKind::kOrbit);
  EXPECT_LT(path.capture.focus.norm(), 0.15);
}

TEST(CameraPath, CapturesWithoutAPathAreRefused) {
  EXPECT_THROW(nerf::FitCameraPath(io::Scene(), 10), io::Error);
  std::vector<io::Rigid3d> rotation_only;
  for (int i = 0; i < 8; ++i) {
    rotation_only.push_back(LookAt({1, 1, 1}, Vector3d(1, 1, 1) + OnSphere(5 * i, 0, 1), Vector3d::UnitZ()));
  }
  EXPECT_THROW(nerf::FitCameraPath(MakeScene(rotation_only), 10), io::Error);
}

}  // namespace
