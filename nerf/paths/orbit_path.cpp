// Paths around a subject, and before it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "io/base/median.h"
#include "io/scene/decomposition.h"
#include "nerf/paths/path_shapes.h"

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
// Half-width of the elevation average around the ring of a full orbit: as wide as that of the azimuth.
constexpr double kRingWidth = 15 * kDeg;
// Steps in which the ring is sought: a third of the half-widths.
constexpr double kRingStep = 5 * kDeg;
// Share of the way from the focus to where the nearby cameras looked: framed as they did it, without losing
// the subject where they came close to a part of it.
constexpr double kAimShare = 0.5;
// Cameras count by how they frame the subject: those that came so much nearer show a part of it, and those
// that look so far beside it something else. A quarter of the angle that a common lens sees.
constexpr double kFramingPower = 4, kFramingAngle = 15 * kDeg;
// An arc ends where the cameras came nearer than this share of its median distance: a subject that commonly
// takes three quarters of the picture is cut off by its edge there.
constexpr double kLeastDistance = 0.75;
// Steps in which that is sought.
constexpr double kArcStep = 3 * kDeg;
// Cameras beyond either end of an arc: two, when there are plenty.
constexpr std::size_t kMaxBeyond = 2, kCamerasPerBeyond = 16;
// Straight above the focus an upright camera has no direction to lean.
constexpr double kMaxElevation = 80 * kDeg;
// Half axes of the sway in standard deviations of the cameras: 0.6 of the half width of evenly filled ground,
// and 0.85 of a ring's radius.
constexpr double kSwaySigmas = 1.2;

struct Spherical {
  double azimuth, elevation, distance;
  Vector3d aim;  // the point of the optical axis that is nearest to the focus
  double framing;
};

// Columns: azimuth 0, azimuth 90 degrees, up.
Matrix3d OrbitAxes(const Vector3d& up) {
  const Vector3d x = up.unitOrthogonal();
  Matrix3d axes;
  axes << x, up.cross(x), up;
  return axes;
}

double WrapAngle(double angle) { return std::remainder(angle, 2 * kPi); }

std::vector<Spherical> AroundFocus(const std::vector<io::Rigid3d>& cameras,
                                   const Vector3d& focus,
                                   const Matrix3d& axes) {
  std::vector<Spherical> around;
  for (const io::Rigid3d& camera : cameras) {
    const Vector3d offset = axes.transpose() * (camera.translation - focus);
    const Vector3d view = -camera.rotation.col(2), way = focus - camera.translation;
    const double beside = std::atan2(way.cross(view).norm(), way.dot(view)) / kFramingAngle;
    around.push_back({std::atan2(offset.y(), offset.x()),
                      std::atan2(offset.z(), std::hypot(offset.x(), offset.y())),
                      offset.norm(),
                      camera.translation + way.dot(view) * view,
                      std::pow(offset.norm(), kFramingPower) * std::exp(-0.5 * beside * beside)});
  }
  return around;
}

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
  const auto first = static_cast<std::size_t>(std::max_element(gaps.begin(), gaps.end()) - gaps.begin());
  const double largest = gaps[first];
  gaps[first] = 0;
  return {azimuths[first], 2 * kPi - largest, *std::max_element(gaps.begin(), gaps.end())};
}

// Means over the cameras around `azimuth`, and the spread of their elevation.
struct LocalMean {
  double elevation, distance, elevation_spread;
  Vector3d aim;
};

// With a ring, of the cameras near that elevation.
LocalMean MeanNear(const std::vector<Spherical>& cameras,
                   double azimuth,
                   double sigma,
                   std::optional<double> ring) {
  double weights = 0, elevation = 0, elevation2 = 0, distance = 0;
  Vector3d aim = Vector3d::Zero();
  for (const Spherical& camera : cameras) {
    const double offset = WrapAngle(camera.azimuth - azimuth) / sigma;
    const double above = ring ? (camera.elevation - *ring) / kRingWidth : 0;
    const double weight = camera.framing * std::exp(-0.5 * (offset * offset + above * above));
    weights += weight;
    elevation += weight * camera.elevation;
    elevation2 += weight * camera.elevation * camera.elevation;
    distance += weight * camera.distance;
    aim += weight * camera.aim;
  }
  elevation /= weights;
  return {elevation,
          distance / weights,
          std::sqrt(std::max(0.0, elevation2 / weights - elevation * elevation)),
          aim / weights};
}

// The elevation at which cameras stand on all sides: the mean over the azimuths of the logarithm of their
// density is largest. The mean elevation of two rings of cameras would lie between them, where nobody stood.
double BestRing(const std::vector<Spherical>& cameras, double sigma) {
  double best = 0, most = -std::numeric_limits<double>::infinity();
  const int n_elevations = static_cast<int>(kMaxElevation / kRingStep),
            n_azimuths = static_cast<int>(std::lround(2 * kPi / kRingStep));
  for (int e = -n_elevations; e <= n_elevations; ++e) {
    double score = 0;
    for (int a = 0; a < n_azimuths; ++a) {
      double density = std::numeric_limits<double>::min();  // no logarithm of 0
      for (const Spherical& camera : cameras) {
        const double offset = WrapAngle(camera.azimuth - a * kRingStep) / sigma,
                     above = (camera.elevation - e * kRingStep) / kRingWidth;
        density += camera.framing * std::exp(-0.5 * (offset * offset + above * above));
      }
      score += std::log(density);
    }
    if (score > most) most = score, best = e * kRingStep;
  }
  return best;
}

// Without the way of the outermost cameras at either end: there a picture of the path, which looks as the
// cameras nearby do in the mean, would have corners that none of them saw.
Arc BetweenCameras(const std::vector<Spherical>& cameras, const Arc& arc) {
  std::vector<double> ways;  // along the arc
  for (const Spherical& camera : cameras)
    ways.push_back(std::clamp(
        WrapAngle(camera.azimuth - arc.start - 0.5 * arc.length) + 0.5 * arc.length, 0.0, arc.length));
  std::sort(ways.begin(), ways.end());
  const std::size_t beyond = std::min(kMaxBeyond, ways.size() / kCamerasPerBeyond);
  const double first = ways[beyond], last = ways[ways.size() - 1 - beyond];
  return {arc.start + first, last - first, arc.largest_inner_gap};
}

// The part of an arc between the first and the last place from which the subject is seen whole.
Arc WithWholeSubject(const std::vector<Spherical>& cameras, const Arc& arc, double sigma) {
  std::vector<double> distances;
  const int n_steps = std::max(1, static_cast<int>(arc.length / kArcStep));
  const double step = arc.length / n_steps;
  for (int i = 0; i <= n_steps; ++i)
    distances.push_back(MeanNear(cameras, arc.start + i * step, sigma, {}).distance);
  const double least = kLeastDistance * io::Median(distances);
  const auto is_whole = [least](double distance) { return distance >= least; };
  const auto before = std::find_if(distances.begin(), distances.end(), is_whole) - distances.begin();
  const auto after = std::find_if(distances.rbegin(), distances.rend(), is_whole) - distances.rbegin();
  return {arc.start + static_cast<double>(before) * step,
          arc.length - static_cast<double>(before + after) * step,
          arc.largest_inner_gap};
}

}  // namespace

void FitOrbit(const std::vector<io::Rigid3d>& cameras, int frames, CameraPath* path) {
  const Vector3d& focus = path->capture.focus;
  const Matrix3d axes = OrbitAxes(path->capture.up);
  const std::vector<Spherical> around = AroundFocus(cameras, focus, axes);
  Arc arc = CoveredArc(around);
  const bool closed = 2 * kPi - arc.length < kOpenGap;
  path->kind = closed ? PathKind::kOrbit : PathKind::kArc;
  const double sigma = std::max(kSmoothing, 0.5 * arc.largest_inner_gap);
  if (!closed) arc = WithWholeSubject(around, BetweenCameras(around, arc), sigma);
  path->arc_deg = closed ? 360 : arc.length / kDeg;
  const double start = closed ? around.front().azimuth : arc.start;
  // An arc swings up and down through all elevations; an orbit keeps to one.
  std::optional<double> ring;
  if (closed) ring = BestRing(around, sigma);
  for (int i = 0; i < frames; ++i) {
    const double phase = 2 * kPi * i / frames;
    const double azimuth = closed ? start + phase : start + 0.5 * arc.length * (1 - std::cos(phase));
    const LocalMean near = MeanNear(around, azimuth, sigma, ring);
    const double lift = closed ? 0 : near.elevation_spread * std::sin(phase);
    const double elevation = std::clamp(near.elevation + lift, -kMaxElevation, kMaxElevation);
    const Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                             std::cos(elevation) * std::sin(azimuth),
                             std::sin(elevation));
    const Vector3d aim = focus + kAimShare * (near.aim - focus);
    path->world_from_cam.push_back(LookAt(focus + near.distance * (axes * direction), aim, path->capture.up));
  }
}

void FitSway(const std::vector<io::Rigid3d>& cameras, int frames, CameraPath* path) {
  const CaptureGeometry& capture = path->capture;
  path->kind = PathKind::kSway;
  Matrix3d spread = Matrix3d::Zero();
  for (const io::Rigid3d& camera : cameras) {
    Vector3d offset = camera.translation - capture.centre;
    offset -= offset.dot(capture.view) * capture.view;
    spread += offset * offset.transpose() / static_cast<double>(cameras.size());
  }
  const auto [variances, axes] = io::EigenDecomposition(spread);
  const Vector3d wide = kSwaySigmas * std::sqrt(variances[2]) * axes.col(2),
                 narrow = kSwaySigmas * std::sqrt(std::max(0.0, variances[1])) * axes.col(1);
  std::vector<double> weights(cameras.size());
  for (int i = 0; i < frames; ++i) {
    const double phase = 2 * kPi * i / frames;
    const Vector3d place = capture.centre + std::cos(phase) * wide + std::sin(phase) * narrow;
    for (std::size_t k = 0; k < cameras.size(); ++k) {
      // As wide as the cameras spread: near ones say more about where to look, and no single one decides.
      const double distance2 = (cameras[k].translation - place).squaredNorm() / variances.sum();
      weights[k] = std::exp(-0.5 * distance2);
    }
    path->world_from_cam.push_back({MeanPose(cameras, weights).rotation, place});
  }
}

}  // namespace nerf
