#include "sfm/mapping/model_joining.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <unordered_map>

#include "io/base/median.h"
#include "io/base/random.h"
#include "sfm/scene/pose_error.h"

namespace sfm {
namespace {

constexpr int kMinSharedPictures = 5;
constexpr std::size_t kMinSharedPoints = 50;
constexpr double kMaxErrorShare = 0.005;  // of the longer side
constexpr double kMinInlierShare = 0.5;
// Finds three right points with a probability of 1 - 1e-9 where half of them are right: log(1e-9) / log(1 -
// 1/8).
constexpr int kHypotheses = 156;
// Enough for the inlier share to 2 %.
constexpr std::size_t kTestedPoints = 2000;
// Least squares, and inliers anew.
constexpr int kRefinements = 3;
// One picture as the only link. Wrong places give depths that differ by any factor, right ones differ by a
// few per cent where the two models see a point from about the same side (2.5 % in office68, 9 points).
constexpr std::size_t kMinDepthRatios = 8;
constexpr double kDepthRatioSpread = 0.1, kMinDepthAgreement = 0.5;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// A keypoint of a frame of `a`. Positions are compared exactly: both models have them from one database.
struct Keypoint {
  int frame;
  double x, y;
  bool operator==(const Keypoint&) const = default;
};

struct KeypointHash {
  std::size_t operator()(const Keypoint& k) const {
    return std::hash<double>()(k.x) * 31 + std::hash<double>()(k.y) * 17 + Index(k.frame);
  }
};

using PointAt = std::unordered_map<Keypoint, int, KeypointHash>;

// Of each frame of b, the frame of the same picture in a, or -1.
std::vector<int> SharedFrames(const io::ColmapModel& a, const io::ColmapModel& b) {
  std::map<std::string, int> frame_of;
  for (std::size_t i = 0; i < a.scene.frames.size(); ++i)
    frame_of[a.scene.frames[i].image_path.string()] = static_cast<int>(i);
  std::vector<int> shared;
  for (const io::Frame& frame : b.scene.frames) {
    const auto found = frame_of.find(frame.image_path.string());
    shared.push_back(found == frame_of.end() ? -1 : found->second);
  }
  return shared;
}

// Of the given frames of a; -1 stands for none.
PointAt PointsAtKeypoints(const io::ColmapModel& a, const std::vector<int>& frames) {
  std::vector<bool> wanted(a.scene.frames.size(), false);
  for (const int frame : frames) {
    if (frame >= 0) wanted[Index(frame)] = true;
  }
  PointAt points;
  for (const io::Observation& o : a.observations) {
    if (wanted[Index(o.frame_index)]) points[{o.frame_index, o.xy.x(), o.xy.y()}] = o.point_index;
  }
  return points;
}

// A point of each model, seen at the same keypoint.
struct SharedPoint {
  Eigen::Vector3d a, b;
  io::Observation seen;  // by a frame of `a`
};

std::vector<SharedPoint> SharedPoints(const io::ColmapModel& a, const io::ColmapModel& b, int min_pictures) {
  const std::vector<int> shared = SharedFrames(a, b);
  if (std::count_if(shared.begin(), shared.end(), [](int i) { return i >= 0; }) < min_pictures) return {};
  const PointAt point_at = PointsAtKeypoints(a, shared);
  std::vector<SharedPoint> points;
  for (io::Observation o : b.observations) {
    const int frame = shared[Index(o.frame_index)];
    const auto found = point_at.find({frame, o.xy.x(), o.xy.y()});
    if (frame < 0 || found == point_at.end()) continue;
    const Eigen::Vector3d in_b = b.scene.points[Index(o.point_index)].xyz;
    o.frame_index = frame;
    points.push_back({a.scene.points[Index(found->second)].xyz, in_b, o});
  }
  return points;
}

bool Agrees(const io::Scene& a, const io::Sim3d& a_from_b, const SharedPoint& point) {
  const io::Frame& frame = a.frames[Index(point.seen.frame_index)];
  const io::Camera& camera = a.cameras[Index(frame.camera_index)];
  const auto xy = io::ImgFromCam(camera, frame.world_from_cam.Inverse() * (a_from_b * point.b));
  return xy && (*xy - point.seen.xy).norm() < kMaxErrorShare * std::max(camera.width, camera.height);
}

std::optional<io::Sim3d> Fit(const std::vector<SharedPoint>& points) {
  std::vector<Eigen::Vector3d> in_a, in_b;
  for (const SharedPoint& point : points) {
    in_a.push_back(point.a);
    in_b.push_back(point.b);
  }
  return AlignCentres(in_b, in_a);
}

std::vector<SharedPoint> Inliers(const io::Scene& a,
                                 const io::Sim3d& a_from_b,
                                 const std::vector<SharedPoint>& points) {
  std::vector<SharedPoint> inliers;
  for (const SharedPoint& point : points) {
    if (Agrees(a, a_from_b, point)) inliers.push_back(point);
  }
  return inliers;
}

std::vector<SharedPoint> EvenlyChosen(const std::vector<SharedPoint>& points, std::size_t most) {
  const std::size_t n = std::min(points.size(), most);
  std::vector<SharedPoint> chosen;
  for (std::size_t i = 0; i < n; ++i) chosen.push_back(points[i * points.size() / n]);
  return chosen;
}

// As io::ColmapModel promises. Observations of a point keep their order.
void OrderByPoint(io::ColmapModel* model) {
  std::vector<std::size_t> next(model->scene.points.size() + 1, 0);
  for (const io::Observation& o : model->observations) ++next[Index(o.point_index) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<io::Observation> ordered(model->observations.size());
  for (const io::Observation& o : model->observations) ordered[next[Index(o.point_index)]++] = o;
  model->observations = std::move(ordered);
  for (io::Point3D& point : model->scene.points) point.frame_indices.clear();
  for (const io::Observation& o : model->observations)
    model->scene.points[Index(o.point_index)].frame_indices.push_back(o.frame_index);
}

}  // namespace

std::optional<io::Sim3d> AlignModels(const io::ColmapModel& a, const io::ColmapModel& b) {
  const std::vector<SharedPoint> points = SharedPoints(a, b, kMinSharedPictures);
  if (points.size() < kMinSharedPoints) return std::nullopt;
  const std::vector<SharedPoint> tested = EvenlyChosen(points, kTestedPoints);
  std::vector<SharedPoint> best;
  for (int i = 0; i < kHypotheses; ++i) {
    io::Random random(0, io::Stream::kAlignment, 0, static_cast<std::uint64_t>(i));
    std::vector<SharedPoint> sample;
    for (int k = 0; k < 3; ++k)
      sample.push_back(points[random.Below(static_cast<std::uint32_t>(points.size()))]);
    const auto hypothesis = Fit(sample);
    if (!hypothesis) continue;
    std::vector<SharedPoint> inliers = Inliers(a.scene, *hypothesis, tested);
    if (inliers.size() > best.size()) best = std::move(inliers);
  }
  std::optional<io::Sim3d> a_from_b = Fit(best);
  for (int i = 0; i < kRefinements && a_from_b; ++i) {
    best = Inliers(a.scene, *a_from_b, points);
    a_from_b = Fit(best);
  }
  const bool agree = static_cast<double>(best.size()) >= kMinInlierShare * static_cast<double>(points.size());
  return agree ? a_from_b : std::nullopt;
}

std::optional<io::Sim3d> AlignAtPicture(const io::ColmapModel& a, const io::ColmapModel& b) {
  const std::vector<int> shared = SharedFrames(a, b);
  std::map<int, std::vector<SharedPoint>> of_frame;  // of a
  for (const SharedPoint& point : SharedPoints(a, b, 1)) of_frame[point.seen.frame_index].push_back(point);
  const auto most = std::max_element(of_frame.begin(), of_frame.end(), [](const auto& x, const auto& y) {
    return x.second.size() < y.second.size();
  });
  if (most == of_frame.end()) return std::nullopt;
  const io::Rigid3d& in_a = a.scene.frames[Index(most->first)].world_from_cam;
  const auto frame = std::find(shared.begin(), shared.end(), most->first) - shared.begin();
  const io::Rigid3d& in_b = b.scene.frames[static_cast<std::size_t>(frame)].world_from_cam;
  std::vector<double> ratios;
  for (const SharedPoint& point : most->second) {
    const double depth_a = (in_a.Inverse() * point.a).z(), depth_b = (in_b.Inverse() * point.b).z();
    if (depth_a * depth_b > 0) ratios.push_back(depth_a / depth_b);
  }
  if (ratios.size() < kMinDepthRatios) return std::nullopt;
  const double scale = io::Median(ratios);
  const auto agreeing = std::count_if(ratios.begin(), ratios.end(), [&](double ratio) {
    return std::abs(ratio - scale) < kDepthRatioSpread * scale;
  });
  if (static_cast<double>(agreeing) < kMinDepthAgreement * static_cast<double>(ratios.size()))
    return std::nullopt;
  const Eigen::Matrix3d rotation = in_a.rotation * in_b.rotation.transpose();
  return io::Sim3d{scale, rotation, in_a.translation - scale * (rotation * in_b.translation)};
}

void AddModel(const io::ColmapModel& b,
              const io::Sim3d& a_from_b,
              const std::vector<int>& camera_of,
              io::ColmapModel* a) {
  std::vector<int> frame_of = SharedFrames(*a, b);
  PointAt point_at = PointsAtKeypoints(*a, frame_of);
  for (std::size_t i = 0; i < frame_of.size(); ++i) {
    if (frame_of[i] >= 0) continue;
    frame_of[i] = static_cast<int>(a->scene.frames.size());
    io::Frame frame = b.scene.frames[i];
    frame.camera_index = camera_of[i];
    frame.world_from_cam = io::TransformPose(a_from_b, frame.world_from_cam);
    a->scene.frames.push_back(std::move(frame));
  }
  std::vector<int> point_of(b.scene.points.size(), -1);
  const auto at = [&](const io::Observation& o) {
    return point_at.find({frame_of[Index(o.frame_index)], o.xy.x(), o.xy.y()});
  };
  for (const io::Observation& o : b.observations) {
    const auto found = at(o);
    if (found != point_at.end()) point_of[Index(o.point_index)] = found->second;
  }
  for (io::Observation o : b.observations) {
    if (at(o) != point_at.end()) continue;
    int& point = point_of[Index(o.point_index)];
    if (point < 0) {
      point = static_cast<int>(a->scene.points.size());
      a->scene.points.push_back(b.scene.points[Index(o.point_index)]);
      a->scene.points.back().xyz = a_from_b * a->scene.points.back().xyz;
    }
    o.frame_index = frame_of[Index(o.frame_index)];
    o.point_index = point;
    a->observations.push_back(o);
    point_at[{o.frame_index, o.xy.x(), o.xy.y()}] = point;
  }
  OrderByPoint(a);
}

}  // namespace sfm
