#include "sfm/bundle/bundle_state.h"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

#include "io/base/error.h"

namespace sfm {
namespace {

io::Sim3d UnitFromWorld(const io::Scene& scene) {
  const double n = static_cast<double>(scene.frames.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const io::Frame& frame : scene.frames) {
    if (!frame.world_from_cam.translation.allFinite() || !frame.world_from_cam.rotation.allFinite()) {
      throw io::Error(io::ExitCode::kNumeric,
                      frame.image_path.string() + " has a pose that is not finite",
                      "Reconstruct the capture again");
    }
    mean += frame.world_from_cam.translation / n;
  }
  double mean_square = 0;
  for (const io::Frame& frame : scene.frames) {
    mean_square += (frame.world_from_cam.translation - mean).squaredNorm() / n;
  }
  if (!(mean_square > 0)) {
    throw io::Error(io::ExitCode::kNumeric,
                    fmt::format("all {} cameras stand at one place", scene.frames.size()),
                    "Bundle adjustment needs pictures from different places");
  }
  const double scale = 1 / std::sqrt(mean_square);
  const Eigen::Matrix3d rotation = scene.frames.front().world_from_cam.rotation.transpose();
  return {.scale = scale, .rotation = rotation, .translation = -scale * (rotation * mean)};
}

}  // namespace

BundleState ToBundleState(const io::Scene& scene) {
  BundleState state{.unit_from_world = UnitFromWorld(scene)};
  for (const io::Frame& frame : scene.frames) {
    const io::Rigid3d unit_from_cam = io::TransformPose(state.unit_from_world, frame.world_from_cam);
    state.reference_rotations.push_back(unit_from_cam.rotation.transpose());
    PoseVector pose = PoseVector::Zero();
    pose.tail<3>() = unit_from_cam.translation;
    state.poses.push_back(pose);
  }
  for (const io::Point3D& point : scene.points) state.points.push_back(state.unit_from_world * point.xyz);
  for (const io::Camera& camera : scene.cameras) state.intrinsics.push_back(ToVector(camera));
  return state;
}

std::vector<std::size_t> MovingAlone(std::size_t n_frames) {
  std::vector<std::size_t> own(n_frames);
  std::iota(own.begin(), own.end(), std::size_t{0});
  return own;
}

Eigen::Matrix3d RotationFromLeader(const BundleState& state, std::size_t leader, std::size_t frame) {
  if (leader == frame) return Eigen::Matrix3d::Identity();
  return state.reference_rotations[frame] * state.reference_rotations[leader].transpose();
}

void UpdateScene(const BundleState& state, io::Scene* scene) {
  const io::Sim3d world_from_unit = state.unit_from_world.Inverse();
  for (std::size_t i = 0; i < scene->frames.size(); ++i) {
    const Eigen::Quaterniond cam_from_unit(RotationFromVector(state.poses[i].head<3>()) *
                                           state.reference_rotations[i]);
    const Eigen::Matrix3d rotation = cam_from_unit.normalized().toRotationMatrix().transpose();
    scene->frames[i].world_from_cam =
        io::TransformPose(world_from_unit, {rotation, state.poses[i].tail<3>()});
  }
  for (std::size_t i = 0; i < scene->points.size(); ++i) {
    scene->points[i].xyz = world_from_unit * state.points[i];
  }
  for (std::size_t i = 0; i < scene->cameras.size(); ++i) {
    scene->cameras[i] = WithIntrinsics(scene->cameras[i], state.intrinsics[i]);
  }
}

}  // namespace sfm
