#include "nerf/data/capture_geometry.h"

#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/scene/decomposition.h"

namespace nerf {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Optical axes that spread less than about 6 degrees (sin^2) meet nowhere in particular.
constexpr double kMinAxisSpread = 0.01;
// Horizontal axes that spread less than about 8 degrees (sin^2) don't tell what is up.
constexpr double kMinHorizontalSpread = 0.02;
// Camera centres nearer to one another than this share of the depth do not span a path.
constexpr double kMinSpread = 1e-6;
// Rounds of reweighting: a stray axis has lost its pull by then.
constexpr int kFocusRounds = 8;
// Sparse points that are looked at per camera: enough for a median.
constexpr std::size_t kDepthPoints = 2000;

// The point with the least sum of distances to the optical axes, so that a few pictures of something else do
// not shift it (iteratively reweighted least squares). Nothing where the axes are near parallel.
std::optional<Vector3d> MeetingPoint(const std::vector<io::Rigid3d>& poses) {
  std::vector<double> weights(poses.size(), 1.0);
  Vector3d focus = Vector3d::Zero();
  for (int round = 0; round < kFocusRounds; ++round) {
    Matrix3d normal = Matrix3d::Zero();
    Vector3d right = Vector3d::Zero();
    double sum = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Vector3d view = -poses[i].rotation.col(2);
      const Matrix3d off_axis = weights[i] * (Matrix3d::Identity() - view * view.transpose());
      normal += off_axis;
      right += off_axis * poses[i].translation;
      sum += weights[i];
    }
    if (!(io::EigenDecomposition(normal / sum).values[0] > kMinAxisSpread)) return std::nullopt;
    focus = io::SolveSymmetric(normal, right);
    std::vector<double> misses;
    for (const io::Rigid3d& pose : poses) {
      const Vector3d offset = focus - pose.translation, view = -pose.rotation.col(2);
      misses.push_back((offset - offset.dot(view) * view).norm());
    }
    // Axes nearer than the median weigh alike: exact ones would otherwise weigh without bound.
    const double typical = io::Median(misses);
    if (!(typical > 0)) break;
    for (std::size_t i = 0; i < poses.size(); ++i) weights[i] = 1 / std::max(misses[i], typical);
  }
  return focus;
}

double HitShare(const io::Scene& scene, const Vector3d& focus) {
  const auto hits = std::count_if(scene.frames.begin(), scene.frames.end(), [&](const io::Frame& frame) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const auto xy = io::ImgFromCam(camera, frame.world_from_cam.Inverse() * focus);
    return xy && xy->x() >= 0 && xy->y() >= 0 && xy->x() <= camera.width && xy->y() <= camera.height;
  });
  return static_cast<double>(hits) / static_cast<double>(scene.frames.size());
}

// Photographers hold the horizon level: up is the direction most perpendicular to all camera x axes. Where
// these are near parallel, or the pictures are rolled so that this contradicts the mean camera up: that mean.
Vector3d UpDirection(const std::vector<io::Rigid3d>& poses) {
  Matrix3d horizontal = Matrix3d::Zero();
  Vector3d mean_up = Vector3d::Zero();
  for (const io::Rigid3d& pose : poses) {
    const Vector3d x = pose.rotation.col(0);
    horizontal += x * x.transpose();
    mean_up += pose.rotation.col(1);
  }
  mean_up.normalize();
  const auto [spread, axes] = io::EigenDecomposition(horizontal / static_cast<double>(poses.size()));
  const Vector3d normal = axes.col(0);
  if (spread[1] < kMinHorizontalSpread || std::abs(normal.dot(mean_up)) < 0.5) return mean_up;
  return normal.dot(mean_up) > 0 ? normal : -normal;
}

// Median over cameras of the median distance of the sparse points in their pictures; without points the
// middle of the depth range.
double TypicalDepth(const io::Scene& scene) {
  const std::size_t stride = std::max<std::size_t>(1, scene.points.size() / kDepthPoints);
  std::vector<double> medians;
  for (const io::Frame& frame : scene.frames) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const io::Rigid3d cam_from_world = frame.world_from_cam.Inverse();
    std::vector<double> distances;
    for (std::size_t i = 0; i < scene.points.size(); i += stride) {
      const Vector3d x = cam_from_world * scene.points[i].xyz;
      const auto xy = io::ImgFromCam(camera, x);
      if (xy && xy->x() >= 0 && xy->y() >= 0 && xy->x() <= camera.width && xy->y() <= camera.height)
        distances.push_back(x.norm());
    }
    if (!distances.empty()) medians.push_back(io::Median(std::move(distances)));
  }
  return medians.empty() ? 0.5 * (scene.near + scene.far) : io::Median(std::move(medians));
}

double Spacing(const std::vector<io::Rigid3d>& poses, double depth) {
  std::vector<double> nearest;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    double least = 0;
    for (std::size_t j = 0; j < poses.size(); ++j) {
      if (i == j) continue;
      const double motion = Motion(poses[i], poses[j], depth);
      least = least == 0 ? motion : std::min(least, motion);
    }
    nearest.push_back(least);
  }
  return io::Median(std::move(nearest));
}

}  // namespace

std::vector<io::Rigid3d> PosesOf(const io::Scene& scene) {
  std::vector<io::Rigid3d> poses;
  for (const io::Frame& frame : scene.frames) poses.push_back(frame.world_from_cam);
  return poses;
}

double Motion(const io::Rigid3d& a, const io::Rigid3d& b, double depth) {
  const double cosine = 0.5 * ((a.rotation.transpose() * b.rotation).trace() - 1);
  return std::hypot((a.translation - b.translation).norm() / depth, std::acos(std::clamp(cosine, -1.0, 1.0)));
}

io::Rigid3d Between(const io::Rigid3d& a, const io::Rigid3d& b, double share) {
  const Eigen::Quaterniond from(a.rotation), to(b.rotation);
  return {from.slerp(share, to).toRotationMatrix(), a.translation + share * (b.translation - a.translation)};
}

io::Rigid3d MeanPose(std::span<const io::Rigid3d> poses, std::span<const double> weights) {
  const auto heaviest =
      static_cast<std::size_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
  const Eigen::Quaterniond middle(poses[heaviest].rotation);
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  Vector3d place = Vector3d::Zero();
  double sum = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    const Eigen::Quaterniond q(poses[i].rotation);
    rotation += (q.dot(middle) < 0 ? -weights[i] : weights[i]) * q.coeffs();
    place += weights[i] * poses[i].translation;
    sum += weights[i];
  }
  return {Eigen::Quaterniond(rotation.normalized()).toRotationMatrix(), place / sum};
}

io::Rigid3d LookAt(const Vector3d& place, const Vector3d& target, const Vector3d& up) {
  io::Rigid3d pose;
  const Vector3d back = (place - target).normalized(), x = up.cross(back).normalized();
  pose.rotation << x, back.cross(x), back;
  pose.translation = place;
  return pose;
}

CaptureGeometry MeasureCapture(const io::Scene& scene) {
  if (scene.frames.empty()) throw io::Error(io::ExitCode::kBadInput, "a scene without cameras has no path");
  const std::vector<io::Rigid3d> poses = PosesOf(scene);
  const double n = static_cast<double>(poses.size());
  CaptureGeometry capture;
  for (const io::Rigid3d& pose : poses) {
    capture.centre += pose.translation / n;
    capture.view -= pose.rotation.col(2) / n;
  }
  capture.axis_spread = 1 - capture.view.norm();
  capture.view.normalize();
  capture.up = UpDirection(poses);
  capture.depth = TypicalDepth(scene);
  double spread = 0;
  for (const io::Rigid3d& pose : poses) spread = std::max(spread, (pose.translation - capture.centre).norm());
  if (!(spread > kMinSpread * capture.depth)) {
    throw io::Error(io::ExitCode::kBadInput,
                    "all cameras stand in one place; no camera path can be fitted",
                    "Take pictures from different places");
  }
  capture.spacing = Spacing(poses, capture.depth);
  const std::optional<Vector3d> focus = MeetingPoint(poses);
  capture.focus = focus.value_or(capture.centre + capture.depth * capture.view);
  capture.hit_share = focus ? HitShare(scene, *focus) : 0;
  return capture;
}

double LongestFocalLength(const io::Scene& scene) {
  double longest = 0;
  for (const io::Camera& camera : scene.cameras) longest = std::max(longest, camera.fl_x);
  return longest;
}

}  // namespace nerf
