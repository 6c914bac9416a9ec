#include "sfm/scene/normalize.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/scene/decomposition.h"

namespace sfm {
namespace {

using io::Error;
using io::ExitCode;

constexpr double kNear = 2, kFar = 6;
constexpr double kDistance = 0.5 * (kNear + kFar);  // of the median camera from the focus when unbounded
constexpr double kQuantile = 0.005;
constexpr std::size_t kMinFrames = 3;
constexpr std::size_t kMinTrack = 3;          // two rays always meet; the third one proves the point
constexpr double kMaxErrorPx = 2;             // beyond it a point is a mismatch
constexpr std::size_t kMinObservations = 10;  // fewer depths in a frame have no meaningful 0.5 % quantile
// Mean squared sine between the axes and their common direction: below it (6 degrees rms) they are nearly
// parallel and the point nearest to all of them is arbitrary along that direction.
constexpr double kMinAxisSpread = 0.01;
constexpr double kOutlierAxis =
    3;  // axes farther from the focus than 3 medians belong to cameras looking elsewhere
constexpr double kMinMeanUp = 0.5;  // length of the mean up vector; 0.5 is a spread of +-60 degrees
constexpr double kSamePlace =
    1e-9;  // relative to the coordinates: the noise of doubles printed and read again
constexpr double kAabbPadding =
    0.1;  // of the box: surfaces without texture stick out beyond the sparse points

// The value below which the share q lies, counted from the lowest or from the highest. The rank is rounded
// inwards, so that for q > 0 the extreme value itself never counts.
double LowQuantile(std::vector<double> values, double q) {
  const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(values.size() - 1)));
  return io::ValueOfRank(std::move(values), rank);
}

double HighQuantile(std::vector<double> values, double q) {
  for (double& value : values) value = -value;
  return -LowQuantile(std::move(values), q);
}

Eigen::Vector3d Centre(const io::Frame& frame) { return frame.world_from_cam.translation; }
Eigen::Vector3d Axis(const io::Frame& frame) { return -frame.world_from_cam.rotation.col(2); }

Eigen::Vector3d MedianPoint(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d median;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> values;
    for (const Eigen::Vector3d& point : points) values.push_back(point[c]);
    median[c] = io::Median(std::move(values));
  }
  return median;
}

void CheckFrames(const io::Scene& scene) {
  if (scene.frames.size() < kMinFrames) {
    throw Error(
        ExitCode::kNotReconstructible,
        fmt::format("only {} posed pictures, at least {} are needed", scene.frames.size(), kMinFrames),
        "Take more pictures from different places");
  }
  const Eigen::Vector3d first = Centre(scene.frames[0]);
  for (const io::Frame& frame : scene.frames) {
    if ((Centre(frame) - first).norm() > kSamePlace * (1 + first.norm())) return;
  }
  throw Error(ExitCode::kNotReconstructible,
              "all cameras stand at the same place, which shows no depth",
              "Move sideways between pictures");
}

// Indices of the points that n and f may be taken from; all of them when none is good.
std::vector<const io::Point3D*> GoodPoints(const io::Scene& scene) {
  std::vector<const io::Point3D*> good, all;
  for (const io::Point3D& point : scene.points) {
    all.push_back(&point);
    const bool is_long = point.frame_indices.empty() || point.frame_indices.size() >= kMinTrack;
    if (is_long && point.error_px <= kMaxErrorPx) good.push_back(&point);
  }
  return good.empty() ? all : good;
}

bool IsInPicture(const io::Scene& scene, const io::Frame& frame, const Eigen::Vector3d& xyz) {
  const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
  const auto xy = io::ImgFromCam(camera, frame.world_from_cam.Inverse() * xyz);
  return xy && xy->x() >= 0 && xy->y() >= 0 && xy->x() <= camera.width && xy->y() <= camera.height;
}

// [frame][observation]: t of every good point that the frame observes.
std::vector<std::vector<double>> ObservedDepths(const io::Scene& scene,
                                                const std::vector<const io::Point3D*>& points) {
  std::vector<std::vector<double>> depths(scene.frames.size());
  for (const io::Point3D* point : points) {
    const auto add = [&](std::size_t i) {
      depths[i].push_back((point->xyz - Centre(scene.frames[i])).norm());
    };
    for (int i : point->frame_indices) add(static_cast<std::size_t>(i));
    for (std::size_t i = 0; point->frame_indices.empty() && i < scene.frames.size(); ++i) {
      if (IsInPicture(scene, scene.frames[i], point->xyz)) add(i);
    }
  }
  return depths;
}

struct DepthRange {
  double n = 0, f = 0;
  double median = 0;  // median over the frames of their median depth
  bool IsKnown() const { return f > 0; }
  bool IsBounded() const { return IsKnown() && f <= (kFar / kNear) * n; }
};

DepthRange RangeOf(const std::vector<std::vector<double>>& depths) {
  DepthRange range;
  std::vector<double> medians;
  for (const std::vector<double>& t : depths) {
    if (t.size() < kMinObservations) continue;
    const double low = LowQuantile(t, kQuantile), high = HighQuantile(t, kQuantile);
    range.n = medians.empty() ? low : std::min(range.n, low);
    range.f = std::max(range.f, high);
    medians.push_back(io::Median(t));
  }
  if (!medians.empty()) range.median = io::Median(medians);
  return range;
}

// The point minimising sum |(I - d d^T)(p - c)|^2 over the axes (c, d) that `is_used`; nothing when they are
// nearly parallel.
std::optional<Eigen::Vector3d> NearestToAxes(const std::vector<io::Frame>& frames,
                                             const std::vector<bool>& is_used) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double count = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!is_used[i]) continue;
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - Axis(frames[i]) * Axis(frames[i]).transpose();
    a += across;
    b += across * Centre(frames[i]);
    count += 1;
  }
  if (!(io::EigenDecomposition(a).values[0] > kMinAxisSpread * count)) return std::nullopt;
  return io::SolveSymmetric(a, b);
}

std::optional<Eigen::Vector3d> FocusPoint(const std::vector<io::Frame>& frames) {
  std::vector<bool> is_used(frames.size(), true);
  std::optional<Eigen::Vector3d> focus = NearestToAxes(frames, is_used);
  if (!focus) return std::nullopt;
  std::vector<double> distances;
  for (const io::Frame& frame : frames) {
    const Eigen::Vector3d to_focus = *focus - Centre(frame);
    distances.push_back((to_focus - Axis(frame) * Axis(frame).dot(to_focus)).norm());
  }
  const double limit = kOutlierAxis * io::Median(distances);
  for (std::size_t i = 0; i < frames.size(); ++i) is_used[i] = distances[i] <= limit;
  if (const auto refined = NearestToAxes(frames, is_used)) focus = refined;
  const auto in_front = std::count_if(frames.begin(), frames.end(), [&](const io::Frame& frame) {
    return Axis(frame).dot(*focus - Centre(frame)) > 0;
  });
  if (2 * static_cast<std::size_t>(in_front) <= frames.size()) return std::nullopt;
  return focus;
}

// The rotation that turns the cameras' mean up to +z; nothing when they disagree about it.
std::optional<Eigen::Matrix3d> UprightRotation(const std::vector<io::Frame>& frames) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const io::Frame& frame : frames) up += frame.world_from_cam.rotation.col(1);
  up /= static_cast<double>(frames.size());
  if (up.norm() < kMinMeanUp) return std::nullopt;
  return io::RotationBetween(up, Eigen::Vector3d::UnitZ());
}

io::Aabb CubeAround(const Eigen::Vector3d& centre, double half_side) {
  return {centre.array() - half_side, centre.array() + half_side};
}

io::Aabb PaddedBox(const std::vector<Eigen::Vector3d>& points) {
  io::Aabb box;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> values;
    for (const Eigen::Vector3d& point : points) values.push_back(point[c]);
    box.min[c] = LowQuantile(values, kQuantile);
    box.max[c] = HighQuantile(values, kQuantile);
  }
  // The longest side pads them all: a scene of one flat wall still gets a box with a volume.
  const double padding = kAabbPadding * (box.max - box.min).maxCoeff();
  return {box.min.array() - padding, box.max.array() + padding};
}

// Brings all depths between near and far where they fit, else the median camera to kDistance from the focus.
double SceneScale(const io::Scene& scene,
                  const DepthRange& range,
                  const Eigen::Vector3d& focus,
                  bool axes_meet) {
  if (range.IsBounded()) return (kNear + kFar) / (range.n + range.f);
  std::vector<double> distances;
  for (const io::Frame& frame : scene.frames) distances.push_back((Centre(frame) - focus).norm());
  return kDistance / (axes_meet ? io::Median(distances) : range.median);
}

std::string ScaleDecision(const DepthRange& range, double f_over_n) {
  if (!range.IsKnown()) {
    return "scale: no sparse points, so the median camera stands 4 from the centre; coverage unknown";
  }
  return range.IsBounded()
             ? fmt::format("scale: depths have the ratio {:.2f} <= 3, so near 2 and far 6 hold them all",
                           f_over_n)
             : fmt::format(
                   "scale: depths have the ratio {:.2f} > 3, so near 2 and far 6 hold the region of "
                   "interest at the centre; the space outside is unbounded",
                   f_over_n);
}

void ApplySimilarity(const io::Sim3d& scene_from_input, io::Scene* scene) {
  for (io::Frame& frame : scene->frames)
    frame.world_from_cam = io::TransformPose(scene_from_input, frame.world_from_cam);
  for (io::Point3D& point : scene->points) point.xyz = scene_from_input * point.xyz;
  scene->scene_from_sfm = scene_from_input * scene->scene_from_sfm;
}

// Shares of the depths, scaled, that lie in [near, far] and beyond near.
void MeasureCoverage(const std::vector<std::vector<double>>& depths, double scale, NormalizeReport* report) {
  double count = 0, inside = 0, beyond_near = 0;
  for (const std::vector<double>& t : depths) {
    for (double value : t) {
      count += 1;
      beyond_near += scale * value >= kNear;
      inside += scale * value >= kNear && scale * value <= kFar;
    }
  }
  if (count == 0) return;
  report->coverage = inside / count;
  report->coverage_near = beyond_near / count;
}

}  // namespace

NormalizeReport NormalizeScene(const io::Scene& scene) {
  CheckFrames(scene);
  NormalizeReport report;
  const auto decide = [&](const std::string& line) { report.decisions.push_back(line); };
  const std::vector<const io::Point3D*> good = GoodPoints(scene);
  const std::vector<std::vector<double>> depths = ObservedDepths(scene, good);
  const DepthRange range = RangeOf(depths);
  std::vector<Eigen::Vector3d> points;
  for (const io::Point3D* point : good) points.push_back(point->xyz);

  const std::optional<Eigen::Vector3d> focus = FocusPoint(scene.frames);
  if (!focus && !range.IsKnown()) {
    throw Error(
        ExitCode::kNotReconstructible,
        "the optical axes do not meet in front of the cameras and there are no sparse points, so the depth "
        "of the scene is unknown",
        "Give a COLMAP model, or a transforms.json with ply_file_path");
  }
  report.focus = focus ? *focus : MedianPoint(points);
  decide(
      focus
          ? "centre: the point nearest to all optical axes"
          : "centre: the median of the points, because the optical axes do not meet in front of the cameras");
  const std::optional<Eigen::Matrix3d> upright = UprightRotation(scene.frames);
  decide(upright ? "up: the cameras' mean up is +z" : "up: kept, because the cameras disagree about it");

  report.f_over_n = range.n > 0 ? range.f / range.n : 0;
  const bool is_bounded = range.IsBounded();
  decide(ScaleDecision(range, report.f_over_n));
  io::Sim3d scene_from_input;
  scene_from_input.scale = SceneScale(scene, range, report.focus, focus.has_value());
  if (upright) scene_from_input.rotation = *upright;
  scene_from_input.translation = -scene_from_input.scale * (scene_from_input.rotation * report.focus);

  report.scene = scene;
  ApplySimilarity(scene_from_input, &report.scene);
  report.scene.near = kNear;
  report.scene.far = kFar;
  report.scene.unbounded = !is_bounded;
  for (Eigen::Vector3d& point : points) point = scene_from_input * point;
  report.scene.aabb = is_bounded ? PaddedBox(points) : CubeAround(Eigen::Vector3d::Zero(), kDistance - kNear);
  report.depth_min = scene_from_input.scale * range.n;
  report.depth_max = scene_from_input.scale * range.f;
  MeasureCoverage(depths, scene_from_input.scale, &report);
  if (report.coverage) {
    decide(
        fmt::format("coverage: {:.2f} % of the observations lie between near and far, {:.2f} % beyond near",
                    100 * *report.coverage,
                    100 * *report.coverage_near));
  }
  return report;
}

}  // namespace sfm
