#include "nerf/rendering/camera_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/base/error.h"
#include "io/scene/decomposition.h"

namespace nerf {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;
constexpr double kDeg = kPi / 180;

// Cameras further apart than this in azimuth leave a side that nobody has photographed: the path turns back
// there.
constexpr double kOpenGap = 60 * kDeg;
// Half-width of the azimuth average: wide enough to smooth the unsteady hand, narrower than a side of the
// object.
constexpr double kSmoothing = 15 * kDeg;
// Optical axes that spread less than about 6 degrees (sin^2) meet nowhere in particular.
constexpr double kMinAxisSpread = 0.01;
// Horizontal axes that spread less than about 8 degrees (sin^2) don't tell what is up.
constexpr double kMinHorizontalSpread = 0.02;
// Straight above the focus an upright camera has no direction to lean.
constexpr double kMaxElevation = 80 * kDeg;
// Camera centres nearer to one another than this share of their distance to the focus do not span a path.
constexpr double kMinSpread = 1e-6;

struct Spherical {
  double azimuth, elevation, distance;
};

Vector3d MeanCentre(const io::Scene& scene) {
  Vector3d sum = Vector3d::Zero();
  for (const io::Frame& frame : scene.frames) sum += frame.world_from_cam.translation;
  return sum / static_cast<double>(scene.frames.size());
}

// The point with the least sum of squared distances to the optical axes. Where they are near parallel or most
// cameras look away from it: the middle of the depth range in front of the mean camera.
Vector3d FocusPoint(const io::Scene& scene) {
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero(), mean_view = Vector3d::Zero();
  for (const io::Frame& frame : scene.frames) {
    const Vector3d view = -frame.world_from_cam.rotation.col(2);
    const Matrix3d off_axis = Matrix3d::Identity() - view * view.transpose();
    normal += off_axis;
    right += off_axis * frame.world_from_cam.translation;
    mean_view += view;
  }
  const double n = static_cast<double>(scene.frames.size());
  if (io::EigenDecomposition(normal / n).values[0] > kMinAxisSpread) {
    const Vector3d focus = io::SolveSymmetric(normal, right);
    const auto faces = std::count_if(scene.frames.begin(), scene.frames.end(), [&](const io::Frame& frame) {
      return (focus - frame.world_from_cam.translation).dot(frame.world_from_cam.rotation.col(2)) < 0;
    });
    if (2 * faces > static_cast<long>(scene.frames.size())) return focus;
  }
  return MeanCentre(scene) + 0.5 * (scene.near + scene.far) * mean_view.normalized();
}

// Photographers hold the horizon level: up is the direction most perpendicular to all camera x axes. Where
// these are near parallel, or the pictures are rolled so that this contradicts the mean camera up: that mean.
Vector3d UpDirection(const io::Scene& scene) {
  Matrix3d horizontal = Matrix3d::Zero();
  Vector3d mean_up = Vector3d::Zero();
  for (const io::Frame& frame : scene.frames) {
    const Vector3d x = frame.world_from_cam.rotation.col(0);
    horizontal += x * x.transpose();
    mean_up += frame.world_from_cam.rotation.col(1);
  }
  mean_up.normalize();
  const auto [spread, axes] = io::EigenDecomposition(horizontal / static_cast<double>(scene.frames.size()));
  const Vector3d normal = axes.col(0);
  if (spread[1] < kMinHorizontalSpread || std::abs(normal.dot(mean_up)) < 0.5) return mean_up;
  return normal.dot(mean_up) > 0 ? normal : -normal;
}

// Columns: azimuth 0, azimuth 90 degrees, up.
Matrix3d OrbitAxes(const Vector3d& up) {
  const Vector3d x = up.unitOrthogonal();
  Matrix3d axes;
  axes << x, up.cross(x), up;
  return axes;
}

double WrapAngle(double angle) { return std::remainder(angle, 2 * kPi); }

// The covered arc [start, start + length], all but the largest gap between neighbouring azimuths.
struct Arc {
  double start, length, largest_inner_gap;
};

Arc CoveredArc(const std::vector<Spherical>& cameras) {
  std::vector<double> azimuths;
  for (const Spherical& camera : cameras) azimuths.push_back(camera.azimuth);
  std::sort(azimuths.begin(), azimuths.end());
  std::vector<double> gaps;  // gaps[i] precedes azimuths[i]
  for (std::size_t i = 0; i < azimuths.size(); ++i) {
    gaps.push_back(i == 0 ? azimuths.front() + 2 * kPi - azimuths.back() : azimuths[i] - azimuths[i - 1]);
  }
  const std::size_t first = std::max_element(gaps.begin(), gaps.end()) - gaps.begin();
  const double largest = gaps[first];
  gaps[first] = 0;
  return {azimuths[first], 2 * kPi - largest, *std::max_element(gaps.begin(), gaps.end())};
}

// Mean elevation and distance of the cameras around `azimuth`, and the spread of the elevation.
struct LocalMean {
  double elevation, distance, elevation_spread;
};

LocalMean MeanNear(const std::vector<Spherical>& cameras, double azimuth, double sigma) {
  double weights = 0, elevation = 0, elevation2 = 0, distance = 0;
  for (const Spherical& camera : cameras) {
    const double offset = WrapAngle(camera.azimuth - azimuth) / sigma;
    const double weight = std::exp(-0.5 * offset * offset);
    weights += weight;
    elevation += weight * camera.elevation;
    elevation2 += weight * camera.elevation * camera.elevation;
    distance += weight * camera.distance;
  }
  elevation /= weights;
  return {
      elevation, distance / weights, std::sqrt(std::max(0.0, elevation2 / weights - elevation * elevation))};
}

io::Rigid3d LookAtFocus(const Vector3d& centre, const Vector3d& focus, const Vector3d& up) {
  io::Rigid3d pose;
  const Vector3d back = (centre - focus).normalized();
  const Vector3d x = up.cross(back).normalized();
  pose.rotation << x, back.cross(x), back;
  pose.translation = centre;
  return pose;
}

}  // namespace

CameraPath FitOrbit(const io::Scene& scene, int frames) {
  if (scene.frames.empty()) throw io::Error(io::ExitCode::kBadInput, "a scene without cameras has no orbit");
  CameraPath path;
  path.focus = FocusPoint(scene);
  path.up = UpDirection(scene);
  const Matrix3d axes = OrbitAxes(path.up);

  std::vector<Spherical> cameras;
  const Vector3d mean_centre = MeanCentre(scene);
  double spread = 0;
  for (const io::Frame& frame : scene.frames) {
    const Vector3d offset = axes.transpose() * (frame.world_from_cam.translation - path.focus);
    cameras.push_back({std::atan2(offset.y(), offset.x()),
                       std::atan2(offset.z(), std::hypot(offset.x(), offset.y())),
                       offset.norm()});
    spread = std::max(spread, (frame.world_from_cam.translation - mean_centre).norm());
  }
  if (spread < kMinSpread * (mean_centre - path.focus).norm() || spread == 0) {
    throw io::Error(io::ExitCode::kBadInput,
                    "all cameras stand in one place; no camera path can be fitted",
                    "Take pictures from different places");
  }

  const Arc arc = CoveredArc(cameras);
  path.closed = 2 * kPi - arc.length < kOpenGap;
  path.arc_deg = path.closed ? 360 : arc.length / kDeg;
  const double sigma = std::max(kSmoothing, 0.5 * arc.largest_inner_gap);
  const double start = path.closed ? cameras.front().azimuth : arc.start;
  for (int i = 0; i < frames; ++i) {
    const double phase = 2 * kPi * i / frames;
    const double azimuth = path.closed ? start + phase : start + 0.5 * arc.length * (1 - std::cos(phase));
    const LocalMean near = MeanNear(cameras, azimuth, sigma);
    const double sway = path.closed ? 0 : near.elevation_spread * std::sin(phase);
    const double elevation = std::clamp(near.elevation + sway, -kMaxElevation, kMaxElevation);
    const Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                             std::cos(elevation) * std::sin(azimuth),
                             std::sin(elevation));
    path.world_from_cam.push_back(
        LookAtFocus(path.focus + near.distance * (axes * direction), path.focus, path.up));
    path.distance += near.distance / frames;
  }
  return path;
}

}  // namespace nerf
