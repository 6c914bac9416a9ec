// Pictures of a synthetic capture: the truth explains every keypoint, up to what is stated.
#include "sfm/synthetic/synthetic_capture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/support/scenes/capture_truth.h"

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using sfm::CaptureOptions;
using sfm::MakeSyntheticCapture;
using sfm::MatchGraph;
using sfm::Structure;
using sfm::SyntheticCapture;
using sfm::Trajectory;

// Keypoints are floats: half a unit in the last place below 1024 px, and 1e-9 px for the double arithmetic.
constexpr double kStoragePx = 0x1p-15 + 1e-9;
const io::Camera kBarrel{.width = 1024,
                         .height = 768,
                         .fl_x = 700,
                         .fl_y = 690,
                         .cx = 500,
                         .cy = 390,
                         .k1 = -0.47,
                         .k2 = 0.22,
                         .p1 = 1e-3,
                         .p2 = -2e-3};

// The textbook's pinhole with OpenCV's distortion, written without the product's code: camera axes x right,
// y down, z forward.
Vector2d Project(const io::Camera& c, const io::Rigid3d& world_from_cam, const Vector3d& x_world) {
  const Vector3d gl = world_from_cam.rotation.transpose() * (x_world - world_from_cam.translation);
  const double u = gl.x() / -gl.z(), v = -gl.y() / -gl.z(), r2 = u * u + v * v;
  const double radial = 1 + c.k1 * r2 + c.k2 * r2 * r2;
  return {c.fl_x * (u * radial + 2 * c.p1 * u * v + c.p2 * (r2 + 2 * u * u)) + c.cx,
          c.fl_y * (v * radial + c.p1 * (r2 + 2 * v * v) + 2 * c.p2 * u * v) + c.cy};
}

// Largest distance between a keypoint and the projection of its true point; counts the comparisons.
double LargestMiss(const SyntheticCapture& capture, int* compared) {
  const auto points = PointsOfKeypoints(capture);
  double largest = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const io::Frame& frame = capture.truth.frames[i];
    const io::Camera& camera = capture.truth.cameras[static_cast<std::size_t>(frame.camera_index)];
    for (std::size_t k = 0; k < points[i].size() && points[i][k] >= 0; ++k, ++*compared) {
      const Vector3d& x = capture.truth.points[static_cast<std::size_t>(points[i][k])].xyz;
      const Vector2d miss = At(capture.features[i].keypoints[k]) - Project(camera, frame.world_from_cam, x);
      largest = std::max(largest, miss.cwiseAbs().maxCoeff());
    }
  }
  return largest;
}

TEST(SyntheticCapture, TruthProjectsOntoEveryKeypoint) {
  int captures = 0;
  for (const Trajectory trajectory : {Trajectory::kRing,
                                      Trajectory::kArc,
                                      Trajectory::kLine,
                                      Trajectory::kForward,
                                      Trajectory::kRotationOnly,
                                      Trajectory::kTwoClusters,
                                      Trajectory::kSpiral,
                                      Trajectory::kNadirGrid}) {
    for (const Structure structure : {Structure::kBall,
                                      Structure::kPlane,
                                      Structure::kTwoPlanes,
                                      Structure::kLine,
                                      Structure::kCorridor,
                                      Structure::kIdenticalSides,
                                      Structure::kTwoFacades,
                                      Structure::kTiledFloor}) {
      CaptureOptions options{.trajectory = trajectory, .structure = structure, .relief = 0.02};
      options.cameras.push_back(kBarrel);
      const SyntheticCapture capture = MakeSyntheticCapture(options);
      ASSERT_EQ(capture.pictures.size(), 14u);
      int compared = 0;
      EXPECT_LE(LargestMiss(capture, &compared), kStoragePx);
      EXPECT_GT(compared, 14 * 30) << captures;
      for (const sfm::PairMatches& pair : capture.matches) {
        ASSERT_LT(pair.a, pair.b);
        if (structure < Structure::kIdenticalSides) {  // nothing is repeated
          EXPECT_EQ(WrongShare(capture, pair), 0);
        }
      }
      ++captures;
    }
  }
  EXPECT_EQ(captures, 64);
}

TEST(SyntheticCapture, PicturesAndFramesAgree) {
  CaptureOptions options{.focal_guess = 1.5};
  options.cameras.push_back({.width = 768, .height = 1024, .fl_x = 900, .fl_y = 900, .cx = 384, .cy = 512});
  const SyntheticCapture capture = MakeSyntheticCapture(options);
  for (std::size_t i = 0; i < capture.pictures.size(); ++i) {
    const io::Camera& camera = options.cameras[i % 2];
    EXPECT_EQ(capture.pictures[i].name, capture.truth.frames[i].image_path.string());
    EXPECT_EQ(capture.pictures[i].width, camera.width);
    EXPECT_EQ(capture.pictures[i].height, camera.height);
    EXPECT_EQ(capture.pictures[i].focal_px, 1.5 * camera.fl_x);
    EXPECT_EQ(capture.pictures[i].camera_group, std::to_string(i % 2));
    EXPECT_EQ(capture.truth.frames[i].camera_index, static_cast<int>(i % 2));
    for (const sfm::Keypoint& keypoint : capture.features[i].keypoints) {
      EXPECT_TRUE(keypoint.x >= 0 && keypoint.x <= static_cast<float>(camera.width) && keypoint.y >= 0 &&
                  keypoint.y <= static_cast<float>(camera.height));
    }
  }
}

TEST(SyntheticCapture, NoiseHasTheStatedSizeAndLeavesTheWorldAlone) {
  const SyntheticCapture clean = MakeSyntheticCapture({.seed = 5});
  const SyntheticCapture noisy = MakeSyntheticCapture({.noise_px = 0.5, .seed = 5});
  double sum = 0, squares = 0;
  int n = 0;
  for (std::size_t i = 0; i < clean.features.size(); ++i) {
    ASSERT_EQ(clean.features[i].keypoints.size(), noisy.features[i].keypoints.size());
    EXPECT_EQ(clean.truth.frames[i].world_from_cam.translation,
              noisy.truth.frames[i].world_from_cam.translation);
    for (std::size_t k = 0; k < clean.features[i].keypoints.size(); ++k) {
      const Vector2d miss = At(noisy.features[i].keypoints[k]) - At(clean.features[i].keypoints[k]);
      sum += miss.x() + miss.y();
      squares += miss.squaredNorm();
      n += 2;
    }
  }
  ASSERT_GT(n, 5000);
  // Four standard errors: sigma / sqrt(2 n) for the deviation, sigma / sqrt(n) for the mean.
  EXPECT_NEAR(std::sqrt(squares / n), 0.5, 4 * 0.5 / std::sqrt(2.0 * n));
  EXPECT_NEAR(sum / n, 0, 4 * 0.5 / std::sqrt(n));
  EXPECT_EQ(clean.matches.size(), noisy.matches.size());
}

TEST(SyntheticCapture, TheSameSeedGivesTheSameBytes) {
  CaptureOptions options{.noise_px = 0.5, .outlier_share = 0.3, .graph = MatchGraph::kSparse, .seed = 11};
  const auto bytes = [](const CaptureOptions& o) {
    std::string text;
    const SyntheticCapture capture = MakeSyntheticCapture(o);
    for (const sfm::Features& features : capture.features) {
      for (const sfm::Keypoint& k : features.keypoints)
        text.append(reinterpret_cast<const char*>(&k), sizeof k);
    }
    for (const sfm::PairMatches& pair : capture.matches)
      text.append(reinterpret_cast<const char*>(pair.matches.data()),
                  pair.matches.size() * sizeof pair.matches[0]);
    return text;
  };
  const std::string first = bytes(options);
  EXPECT_EQ(first, bytes(options));
  options.seed = 12;
  EXPECT_NE(first, bytes(options));
}

TEST(SyntheticCapture, TrajectoriesAreWhatTheyAreCalled) {
  const auto frames = [](CaptureOptions options) { return MakeSyntheticCapture(options).truth.frames; };
  for (const io::Frame& frame : frames({.trajectory = Trajectory::kLine})) {
    EXPECT_EQ(frame.world_from_cam.rotation, Eigen::Matrix3d::Identity());
    EXPECT_EQ(frame.world_from_cam.translation.y(), 0);
  }
  const auto turning = frames({.trajectory = Trajectory::kRotationOnly});
  for (const io::Frame& frame : turning)
    EXPECT_EQ(frame.world_from_cam.translation, turning[0].world_from_cam.translation);
  EXPECT_NE(turning[0].world_from_cam.rotation, turning[1].world_from_cam.rotation);

  int same_spot = 0;
  const auto ring = frames({.pictures = 21, .rotation_only_share = 0.3});
  for (std::size_t i = 1; i < ring.size(); ++i) {
    same_spot += ring[i].world_from_cam.translation == ring[i - 1].world_from_cam.translation;
    EXPECT_NE(ring[i].world_from_cam.rotation, ring[i - 1].world_from_cam.rotation);
  }
  EXPECT_EQ(same_spot, 6);

  const auto duplicated = frames({.pictures = 5, .duplicates = 7});
  ASSERT_EQ(duplicated.size(), 12u);
  for (std::size_t i = 1; i < 12; ++i) {
    EXPECT_EQ(duplicated[i].world_from_cam.translation == duplicated[0].world_from_cam.translation, i <= 7);
  }
  // The steps of an arc are baseline * distance, up to the hand that shakes a third of one at both ends.
  const auto arc = frames({.trajectory = Trajectory::kArc, .baseline = 0.01});
  const double distance = arc[0].world_from_cam.translation.norm();
  for (std::size_t i = 1; i < arc.size(); ++i) {
    const double step = (arc[i].world_from_cam.translation - arc[i - 1].world_from_cam.translation).norm();
    EXPECT_NEAR(step / distance, 0.01, 0.0065);
  }
}

TEST(SyntheticCapture, AWorldFarAwayIsSeenTheSame) {
  const SyntheticCapture here = MakeSyntheticCapture({});
  const SyntheticCapture away = MakeSyntheticCapture({.scale = 1e-3, .offset = {1e6, -1e6, 1e6}});
  int compared = 0;
  EXPECT_LE(LargestMiss(away, &compared), kStoragePx);
  EXPECT_GT(compared, 3000);
  for (std::size_t i = 0; i < here.features.size(); ++i) {
    const io::Rigid3d &a = here.truth.frames[i].world_from_cam, &b = away.truth.frames[i].world_from_cam;
    EXPECT_LT((1e-3 * a.translation + Vector3d(1e6, -1e6, 1e6) - b.translation).norm(), 1e-9);
    EXPECT_EQ(a.rotation, b.rotation);
    ASSERT_EQ(here.features[i].keypoints.size(), away.features[i].keypoints.size());
    // Coordinates of 1e6 are rounded at 6e-11, vectors of them at 1e-10. At distances of 2.7e-3 and more a
    // camera and a point move a pixel by 1280 * 2e-10 / 2.7e-3 = 1e-4, a little more off the axis.
    for (std::size_t k = 0; k < here.features[i].keypoints.size(); ++k)
      EXPECT_LT((At(here.features[i].keypoints[k]) - At(away.features[i].keypoints[k])).norm(), 2e-4);
  }
}

TEST(SyntheticCapture, ARollingShutterTurnsTheCameraRowByRow) {
  const double turn_deg = 0.9;
  const SyntheticCapture still = MakeSyntheticCapture({});
  const SyntheticCapture rolling = MakeSyntheticCapture({.rolling_shutter_deg = turn_deg});
  const auto points = PointsOfKeypoints(rolling);
  int compared = 0;
  std::vector<double> relative;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const io::Frame& frame = rolling.truth.frames[i];
    EXPECT_EQ(frame.world_from_cam.translation, still.truth.frames[i].world_from_cam.translation);
    for (std::size_t k = 0; k < points[i].size(); ++k, ++compared) {
      const Vector2d at = At(rolling.features[i].keypoints[k]);
      const Vector3d& x = rolling.truth.points[static_cast<std::size_t>(points[i][k])].xyz;
      const double miss = (at - Project(rolling.truth.cameras[0], frame.world_from_cam, x)).norm();
      // A turn by t moves a pixel by at most f t (1 + r^2), with r <= 0.5 the distance from the axis over f.
      const double turned = std::abs(at.y() / 768 - 0.5) * turn_deg * std::numbers::pi / 180;
      EXPECT_LE(miss, 1280 * turned * 1.25 + 0.01);
      if (turned > 1e-3) relative.push_back(miss / (1280 * turned));
    }
  }
  EXPECT_GT(compared, 3000);
  std::sort(relative.begin(), relative.end());
  // Axes point anywhere: half of them lie within 60 degrees of the picture's plane and move it by sin 60.
  EXPECT_GT(relative[relative.size() / 2], 0.6);
}

TEST(SyntheticCapture, NothingIsSeenWhereTheDistortionFoldsBack) {
  // 1 + 3 k1 r^2 = 0 at r = 0.816: beyond it the picture of a point comes back towards the middle.
  io::Camera camera{
      .width = 1000, .height = 1000, .fl_x = 300, .fl_y = 300, .cx = 500, .cy = 500, .k1 = -0.5};
  const SyntheticCapture capture = MakeSyntheticCapture({.trajectory = Trajectory::kForward,
                                                         .structure = Structure::kCorridor,
                                                         .points = 3000,
                                                         .cameras = {camera}});
  int compared = 0, hidden = 0;
  for (const io::Point3D& point : capture.truth.points) {
    for (int i = 0; i < 14; ++i) {
      const io::Rigid3d pose = capture.truth.frames[static_cast<std::size_t>(i)].world_from_cam;
      const Vector3d x = pose.Inverse() * point.xyz;
      if (x.z() >= 0) continue;
      const bool is_seen = std::count(point.frame_indices.begin(), point.frame_indices.end(), i) == 1;
      const double r = x.head<2>().norm() / -x.z();
      EXPECT_EQ(is_seen, r < std::sqrt(1 / 1.5)) << r;
      ++compared, hidden += !is_seen;
    }
  }
  EXPECT_GT(compared, 10000);
  EXPECT_GT(hidden, 1000);
}

TEST(SyntheticCapture, FarPointsHaveNoParallax) {
  const SyntheticCapture capture = MakeSyntheticCapture({.points = 1000, .far_share = 0.4});
  int far_points = 0;
  for (const io::Point3D& point : capture.truth.points) far_points += point.xyz.norm() > 1e4;
  EXPECT_EQ(far_points, 400);
}

}  // namespace
