// Normalisation against scenes whose answer is known: containment per camera, the exact chain, wild data,
// refusals.
#include "sfm/scene/normalize.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "io/base/error.h"
#include "tests/support/scenes/look_at.h"

namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

Vector3d RandomInBall(std::mt19937* random, double radius) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Vector3d p;
  do p = {uniform(*random), uniform(*random), uniform(*random)};
  while (p.norm() > 1);
  return radius * p;
}

void AddPoints(io::Scene* scene, int count, double radius, bool has_tracks) {
  std::mt19937 random(3);
  for (int i = 0; i < count; ++i) {
    io::Point3D point;
    point.xyz = RandomInBall(&random, radius);
    for (std::size_t k = 0; has_tracks && k < scene->frames.size(); ++k)
      point.frame_indices.push_back(static_cast<int>(k));
    scene->points.push_back(point);
  }
}

// 24 cameras on a ring of radius 3 around a ball of points; then the whole world is moved by
// `world_from_scene`.
io::Scene Orbit(double ball_radius, const io::Sim3d& world_from_scene = {}, bool has_tracks = true) {
  io::Scene scene;
  scene.cameras = {{.width = 64, .height = 48, .fl_x = 50, .fl_y = 50, .cx = 32, .cy = 24}};
  for (int i = 0; i < 24; ++i) {
    const double angle = 2 * kPi * i / 24;
    scene.frames.push_back(
        {"",
         0,
         LookAt({3 * std::cos(angle), 3 * std::sin(angle), 0.8}, Vector3d::Zero(), Vector3d::UnitZ())});
  }
  AddPoints(&scene, 600, ball_radius, has_tracks);
  for (io::Frame& frame : scene.frames)
    frame.world_from_cam = io::TransformPose(world_from_scene, frame.world_from_cam);
  for (io::Point3D& point : scene.points) point.xyz = world_from_scene * point.xyz;
  return scene;
}

io::Sim3d AwkwardWorld(double scale) {
  return {scale,
          Eigen::AngleAxisd(2, Vector3d(1, -2, 0.5).normalized()).toRotationMatrix(),
          {10 * scale, -70, 5}};
}

// The smallest share, over the cameras, of points with near <= |x - c| <= far.
double WorstContainment(const io::Scene& scene, std::size_t n_points) {
  double worst = 1;
  for (const io::Frame& frame : scene.frames) {
    double inside = 0;
    for (std::size_t i = 0; i < n_points; ++i) {
      const double t = (scene.points[i].xyz - frame.world_from_cam.translation).norm();
      inside += t >= scene.near && t <= scene.far;
    }
    worst = std::min(worst, inside / static_cast<double>(n_points));
  }
  return worst;
}

io::ExitCode RefusalOf(const io::Scene& scene) {
  try {
    sfm::NormalizeScene(scene);
    return io::ExitCode::kOk;
  } catch (const io::Error& error) {
    return error.code();
  }
}

TEST(Normalize, BoundedSceneFitsBetweenNearAndFarInAnyGauge) {
  const auto reference = sfm::NormalizeScene(Orbit(1));
  for (double scale : {1e-3, 1.0, 1e4}) {
    const auto report = sfm::NormalizeScene(Orbit(1, AwkwardWorld(scale)));
    EXPECT_FALSE(report.scene.unbounded);
    EXPECT_EQ(report.scene.near, 2);
    EXPECT_EQ(report.scene.far, 6);
    EXPECT_GE(WorstContainment(report.scene, 600), 0.99);
    EXPECT_GE(*report.coverage, 0.99);
    EXPECT_GE(report.depth_min, 2 - 1e-9);
    EXPECT_LE(report.depth_max, 6 + 1e-9);
    EXPECT_NEAR(report.depth_min + report.depth_max, 8, 1e-9);
    EXPECT_NEAR(report.scene.scene_from_sfm.scale * scale / reference.scene.scene_from_sfm.scale, 1, 1e-9);
    for (const io::Point3D& point : report.scene.points) EXPECT_LT(point.xyz.norm(), 2);
  }
}

TEST(Normalize, ScaleIsEightOverNPlusFOfTheQuantiles) {
  // 134 points on the axis of each of three cameras around the origin, equally spaced in depth. Each is
  // observed three times by its camera alone, so that 402 depths stand in groups of three.
  const double first[] = {3, 3.2, 3.3}, last[] = {4.6, 5, 4.5};
  io::Scene scene;
  scene.cameras = {{.width = 64, .height = 48, .fl_x = 50, .fl_y = 50, .cx = 32, .cy = 24}};
  for (int k = 0; k < 3; ++k) {
    const Vector3d centre(4 * std::cos(2 * kPi * k / 3), 4 * std::sin(2 * kPi * k / 3), 0);
    scene.frames.push_back({"", 0, LookAt(centre, Vector3d::Zero(), Vector3d::UnitZ())});
    for (int i = 0; i <= 133; ++i) {
      io::Point3D point;
      point.xyz = centre * (1 - (first[k] + i / 133.0 * (last[k] - first[k])) / 4);
      point.frame_indices = {k, k, k};
      scene.points.push_back(point);
    }
  }
  const auto report = sfm::NormalizeScene(scene);
  // Rank 0.005 * 401 = 2.005, rounded inwards to 3, is the second lowest point; likewise the second highest.
  const double n = 3 + (4.6 - 3) / 133, f = 5 - (5 - 3.2) / 133;
  EXPECT_NEAR(report.f_over_n, f / n, 1e-12);
  EXPECT_NEAR(report.scene.scene_from_sfm.scale, 8 / (n + f), 1e-12);
  EXPECT_NEAR(report.focus.norm(), 0, 1e-12);
}

TEST(Normalize, ChainInvertsToTheInput) {
  io::Scene input = Orbit(1, AwkwardWorld(7));
  input.scene_from_sfm = {0.25, Eigen::AngleAxisd(1, Vector3d::UnitX()).toRotationMatrix(), {1, 2, 3}};
  const auto report = sfm::NormalizeScene(input);
  const io::Sim3d input_from_sfm = input.scene_from_sfm, scene_from_sfm = report.scene.scene_from_sfm;
  const io::Sim3d identity = scene_from_sfm.Inverse() * scene_from_sfm;
  EXPECT_NEAR(identity.scale, 1, 1e-12);
  EXPECT_NEAR((identity.rotation - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
  const io::Sim3d input_from_scene = input_from_sfm * scene_from_sfm.Inverse();
  for (std::size_t i = 0; i < input.points.size(); ++i) {
    const Vector3d restored = input_from_scene * report.scene.points[i].xyz;
    EXPECT_NEAR((restored - input.points[i].xyz).norm() / input.points[i].xyz.norm(), 0, 1e-12);
  }
  for (std::size_t i = 0; i < input.frames.size(); ++i) {
    const io::Rigid3d restored = io::TransformPose(input_from_scene, report.scene.frames[i].world_from_cam);
    EXPECT_NEAR((restored.rotation - input.frames[i].world_from_cam.rotation).norm(), 0, 1e-12);
    EXPECT_NEAR((restored.translation - input.frames[i].world_from_cam.translation).norm() /
                    input.frames[i].world_from_cam.translation.norm(),
                0,
                1e-12);
  }
}

TEST(Normalize, PicturesStayTheSame) {
  const io::Scene input = Orbit(1, AwkwardWorld(7));
  const io::Scene output = sfm::NormalizeScene(input).scene;
  for (std::size_t i = 0; i < 20; ++i) {
    const auto before =
        io::ImgFromCam(input.cameras[0], input.frames[i].world_from_cam.Inverse() * input.points[i].xyz);
    const auto after =
        io::ImgFromCam(output.cameras[0], output.frames[i].world_from_cam.Inverse() * output.points[i].xyz);
    EXPECT_NEAR((*before - *after).norm(), 0, 1e-9);
  }
}

TEST(Normalize, MeanUpBecomesZAndTheFocusTheOrigin) {
  const auto report = sfm::NormalizeScene(Orbit(1, AwkwardWorld(2)));
  Vector3d up = Vector3d::Zero();
  for (const io::Frame& frame : report.scene.frames) up += frame.world_from_cam.rotation.col(1);
  EXPECT_NEAR((up.normalized() - Vector3d::UnitZ()).norm(), 0, 1e-9);
  EXPECT_NEAR((report.focus - AwkwardWorld(2).translation).norm(), 0, 1e-9);
}

TEST(Normalize, OneWildPointOrCameraChangesNothing) {
  const auto clean = sfm::NormalizeScene(Orbit(1));
  io::Scene wild = Orbit(1);
  wild.points.push_back(wild.points[0]);
  wild.points.back().xyz = {1e4, 0, 0};
  wild.points.push_back(wild.points[0]);
  wild.points.back().xyz = wild.frames[0].world_from_cam.translation;  // inside a camera
  const auto report = sfm::NormalizeScene(wild);
  EXPECT_FALSE(report.scene.unbounded);
  EXPECT_NEAR(report.scene.scene_from_sfm.scale / clean.scene.scene_from_sfm.scale, 1, 0.01);
  EXPECT_GE(WorstContainment(report.scene, 600), 0.99);
  EXPECT_LT(report.scene.aabb.max.x(), 3);

  io::Scene looks_away = Orbit(1);
  looks_away.frames[5].world_from_cam = LookAt({3, 0, 1}, {40, -30, 90}, Vector3d::UnitZ());
  EXPECT_NEAR(sfm::NormalizeScene(looks_away).focus.norm(), 0, 0.05);
}

TEST(Normalize, BadPointsAreLeftOutWhereKnown) {
  io::Scene scene = Orbit(1);
  const double scale = sfm::NormalizeScene(scene).scene.scene_from_sfm.scale;
  for (int i = 0; i < 200; ++i) {
    io::Point3D blunder = scene.points[static_cast<std::size_t>(i)];
    blunder.xyz *= 100;
    if (i % 2)
      blunder.error_px = 2.5;
    else
      blunder.frame_indices.resize(2);
    scene.points.push_back(blunder);
  }
  const auto report = sfm::NormalizeScene(scene);
  EXPECT_EQ(report.scene.scene_from_sfm.scale, scale);
  EXPECT_EQ(report.scene.points.size(), 800u);
}

TEST(Normalize, WideDepthRangeKeepsTheRegionOfInterestAndSaysSo) {
  io::Scene scene = Orbit(0.8, AwkwardWorld(5));
  const io::Sim3d world = AwkwardWorld(5);
  std::mt19937 random(5);
  for (int i = 0; i < 300; ++i) {
    io::Point3D point = scene.points[0];
    point.xyz = world * (40 * RandomInBall(&random, 1).normalized());
    scene.points.push_back(point);
  }
  const auto report = sfm::NormalizeScene(scene);
  EXPECT_TRUE(report.scene.unbounded);
  EXPECT_GT(report.f_over_n, 3);
  EXPECT_NEAR(*report.coverage, 600.0 / 900, 0.01);
  EXPECT_NEAR(*report.coverage_near, 1, 0.01);
  EXPECT_GE(WorstContainment(report.scene, 600), 0.99);
  for (const io::Frame& frame : report.scene.frames)
    EXPECT_NEAR(frame.world_from_cam.translation.norm(), 4, 1e-9);
  EXPECT_NEAR((report.scene.aabb.max - Vector3d(2, 2, 2)).norm(), 0, 1e-12);
}

TEST(Normalize, WithoutTracksThePictureDecidesWhatACameraSees) {
  const auto report = sfm::NormalizeScene(Orbit(1, {}, false));
  EXPECT_FALSE(report.scene.unbounded);
  EXPECT_GE(*report.coverage, 0.99);
  io::Scene above = Orbit(0.3, {}, false);
  const double scale = sfm::NormalizeScene(above).scene.scene_from_sfm.scale;
  for (int i = 0; i < 50; ++i) {
    io::Point3D point;  // in front of every camera, but above every picture
    point.xyz = {0, 0, 5 + 0.01 * i};
    above.points.push_back(point);
  }
  EXPECT_EQ(sfm::NormalizeScene(above).scene.scene_from_sfm.scale, scale);
}

TEST(Normalize, WithoutPointsTheAxesSetTheScale) {
  io::Scene scene = Orbit(1, AwkwardWorld(3));
  scene.points.clear();
  const auto report = sfm::NormalizeScene(scene);
  EXPECT_FALSE(report.coverage.has_value());
  EXPECT_TRUE(report.scene.unbounded);
  for (const io::Frame& frame : report.scene.frames)
    EXPECT_NEAR(frame.world_from_cam.translation.norm(), 4, 1e-9);
}

TEST(Normalize, NearlyParallelAxesAreCentredOnThePoints) {
  io::Scene scene;  // cameras on a line; the axes meet 50 away, the points are 10 away
  scene.cameras = {{.width = 64, .height = 48, .fl_x = 50, .fl_y = 50, .cx = 32, .cy = 24}};
  for (int i = 0; i < 9; ++i)
    scene.frames.push_back({"", 0, LookAt({0.5 * i - 2, 0, 0}, {0, 50, 0}, Vector3d::UnitZ())});
  AddPoints(&scene, 400, 2, true);
  for (io::Point3D& point : scene.points) point.xyz.y() += 10;
  const auto report = sfm::NormalizeScene(scene);
  EXPECT_NEAR((report.focus - Vector3d(0, 10, 0)).norm(), 0, 0.3);
  EXPECT_GE(WorstContainment(report.scene, 400), 0.99);
  scene.points.clear();
  EXPECT_EQ(RefusalOf(scene), io::ExitCode::kNotReconstructible);
}

TEST(Normalize, OutwardRigIsCentredOnThePointsNotBehindTheCameras) {
  io::Scene scene;  // cameras on a small half circle looking outwards at half a shell of points
  scene.cameras = {{.width = 64, .height = 48, .fl_x = 30, .fl_y = 30, .cx = 32, .cy = 24}};
  for (int i = 0; i <= 12; ++i) {
    const Vector3d out(std::sin(kPi * i / 12), std::cos(kPi * i / 12), 0);
    scene.frames.push_back({"", 0, LookAt(0.3 * out, 2 * out, Vector3d::UnitZ())});
  }
  std::mt19937 random(2);
  for (int i = 0; i < 800; ++i) {
    io::Point3D point;
    point.xyz = 5 * RandomInBall(&random, 1).normalized();
    point.xyz.x() = std::abs(point.xyz.x());
    scene.points.push_back(point);
  }
  const auto report = sfm::NormalizeScene(scene);
  EXPECT_GT(report.focus.x(), 1);
  EXPECT_FALSE(report.scene.unbounded);
  EXPECT_GE(WorstContainment(report.scene, 800), 0.995);
}

TEST(Normalize, RefusesWhatShowsNoDepth) {
  io::Scene two = Orbit(1);
  two.frames.resize(2);
  for (io::Point3D& point : two.points) point.frame_indices = {0, 1};
  EXPECT_EQ(RefusalOf(two), io::ExitCode::kNotReconstructible);
  io::Scene same = Orbit(1);
  for (io::Frame& frame : same.frames) frame.world_from_cam.translation = {1e3, 2, 3};
  EXPECT_EQ(RefusalOf(same), io::ExitCode::kNotReconstructible);
  EXPECT_EQ(RefusalOf(io::Scene()), io::ExitCode::kNotReconstructible);
  EXPECT_EQ(RefusalOf(Orbit(1)), io::ExitCode::kOk);
}

}  // namespace
