// Synthetic models for the tests of bundle adjustment: cameras on a ring or a line around a cloud of points,
// with observations of known noise.
#pragma once

#include <cmath>
#include <numbers>
#include <random>

#include "io/scene/colmap_model.h"
#include "tests/support/scenes/look_at.h"

// Uniform in [0, 1) and standard normal (Box and Muller), equal in every standard library.
inline double Uniform(std::mt19937_64* random) { return static_cast<double>((*random)() >> 11) * 0x1p-53; }
inline double Normal(std::mt19937_64* random) {
  const double radius = std::sqrt(-2 * std::log1p(-Uniform(random)));
  return radius * std::cos(2 * std::numbers::pi * Uniform(random));
}

inline Eigen::Vector3d RandomVector(std::mt19937_64* random, double size) {
  const double x = Uniform(random), y = Uniform(random), z = Uniform(random);
  return size * Eigen::Vector3d(2 * x - 1, 2 * y - 1, 2 * z - 1);
}

inline io::Camera SmallCamera() {
  return {.width = 640, .height = 480, .fl_x = 500, .fl_y = 500, .cx = 320, .cy = 240};
}

// All parameters away from their defaults.
inline io::Camera DistortedCamera() {
  io::Camera camera = SmallCamera();
  camera.fl_y = 510, camera.cx = 310, camera.k1 = -0.05, camera.k2 = 0.01, camera.p1 = 1e-3,
  camera.p2 = -2e-3;
  return camera;
}

// Cameras without points yet: a ring of radius 3 that looks roughly at the origin.
inline io::ColmapModel Ring(int n_frames, const io::Camera& camera) {
  io::ColmapModel model;
  model.scene.cameras = {camera};
  std::mt19937_64 random(17);
  for (int i = 0; i < n_frames; ++i) {
    const double angle = 2 * std::numbers::pi * i / n_frames;
    const Eigen::Vector3d centre(3 * std::cos(angle), 3 * std::sin(angle), 0.8 * std::sin(3 * angle));
    const Eigen::AngleAxisd roll(0.6 * Uniform(&random), Eigen::Vector3d::UnitZ());
    io::Rigid3d pose = LookAt(centre, RandomVector(&random, 0.2), Eigen::Vector3d::UnitZ());
    pose.rotation = pose.rotation * roll;
    model.scene.frames.push_back({"view " + std::to_string(i) + ".png", 0, pose});
  }
  return model;
}

// Gives a model its observations: every frame that shows a point inside its picture, with Gaussian noise of
// `noise_px` per coordinate. Points seen by fewer than 3 frames are left out.
inline void AddPoint(io::ColmapModel* model,
                     const Eigen::Vector3d& xyz,
                     double noise_px,
                     std::mt19937_64* random) {
  io::Point3D point{.xyz = xyz};
  std::vector<io::Observation> seen;
  for (std::size_t i = 0; i < model->scene.frames.size(); ++i) {
    const io::Frame& frame = model->scene.frames[i];
    const io::Camera& camera = model->scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const auto xy = io::ImgFromCam(camera, frame.world_from_cam.Inverse() * xyz);
    if (!xy || xy->x() < 0 || xy->y() < 0 || xy->x() > camera.width || xy->y() > camera.height) continue;
    const double dx = noise_px * Normal(random), dy = noise_px * Normal(random);
    point.frame_indices.push_back(static_cast<int>(i));
    seen.push_back(
        {static_cast<int>(i), static_cast<int>(model->scene.points.size()), *xy + Eigen::Vector2d(dx, dy)});
  }
  if (seen.size() < 3) return;
  model->scene.points.push_back(point);
  model->observations.insert(model->observations.end(), seen.begin(), seen.end());
}

// A ring around a cube of points with half side 1.2.
inline io::ColmapModel RingModel(
    int n_frames, int n_points, const io::Camera& camera, double noise_px, std::uint64_t seed) {
  io::ColmapModel model = Ring(n_frames, camera);
  std::mt19937_64 random(seed);
  for (int i = 0; i < n_points; ++i) AddPoint(&model, RandomVector(&random, 1.2), noise_px, &random);
  return model;
}

// Panoramas along a line amid a shell of points: of each place four views, "view<side>_<place>.png", each
// turned to the right of the last by a quarter.
inline io::ColmapModel PanoramaModel(int n_places, double noise_px) {
  io::ColmapModel model;
  model.scene.cameras = {SmallCamera()};
  std::mt19937_64 random(11);
  for (int i = 0; i < n_places; ++i) {
    const Eigen::Vector3d centre = Eigen::Vector3d(0.5 * i, 0, 0) + RandomVector(&random, 0.1);
    const io::Rigid3d front =
        LookAt(centre, centre + Eigen::Vector3d(1, 0.1 * i, 0), Eigen::Vector3d::UnitZ());
    for (int side = 0; side < 4; ++side) {
      io::Rigid3d pose = front;
      pose.rotation =
          pose.rotation * Eigen::AngleAxisd(-side * std::numbers::pi / 2, Eigen::Vector3d::UnitY());
      model.scene.frames.push_back(
          {"view" + std::to_string(side) + "_" + std::to_string(i) + ".png", 0, pose});
    }
  }
  for (int i = 0; i < 300; ++i) {
    const double distance = 3 + Uniform(&random);
    const Eigen::Vector3d direction = RandomVector(&random, 1).normalized();
    AddPoint(&model, Eigen::Vector3d(1, 0, 0) + distance * direction, noise_px, &random);
  }
  return model;
}

// A ring whose pictures were focused one by one: a camera each, focal lengths within 3 % of 500 px, one lens.
inline io::ColmapModel OwnFocals(int n_frames, int n_points, double noise_px, std::uint64_t seed) {
  io::Camera camera = SmallCamera();
  camera.cx = 305, camera.k1 = -0.05;
  io::ColmapModel model = Ring(n_frames, camera);
  model.scene.cameras.assign(model.scene.frames.size(), camera);
  std::mt19937_64 random(seed);
  for (std::size_t i = 0; i < model.scene.frames.size(); ++i) {
    const double zoom = 1 + 0.03 * (2 * Uniform(&random) - 1);
    model.scene.frames[i].camera_index = static_cast<int>(i);
    model.scene.cameras[i].fl_x *= zoom, model.scene.cameras[i].fl_y *= zoom;
  }
  for (int i = 0; i < n_points; ++i) AddPoint(&model, RandomVector(&random, 1.2), noise_px, &random);
  return model;
}

// Moves every centre and point by up to `shift` along each axis and turns every camera by up to `turn` rad.
inline void Perturb(io::ColmapModel* model, double shift, double turn, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  for (io::Frame& frame : model->scene.frames) {
    const Eigen::Vector3d axis = RandomVector(&random, 1).normalized();
    frame.world_from_cam.rotation =
        frame.world_from_cam.rotation * Eigen::AngleAxisd(turn * Uniform(&random), axis);
    frame.world_from_cam.translation += RandomVector(&random, shift);
  }
  for (io::Point3D& point : model->scene.points) point.xyz += RandomVector(&random, shift);
}

// Moves the whole world.
inline void Move(io::ColmapModel* model, const io::Sim3d& b_from_a) {
  for (io::Frame& frame : model->scene.frames) {
    frame.world_from_cam = io::TransformPose(b_from_a, frame.world_from_cam);
  }
  for (io::Point3D& point : model->scene.points) point.xyz = b_from_a * point.xyz;
}
