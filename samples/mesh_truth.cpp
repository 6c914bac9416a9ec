#include "samples/mesh_truth.h"

#include <algorithm>
#include <map>
#include <unordered_map>
#include <unordered_set>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/process/parallel.h"
#include "samples/noise.h"
#include "samples/room_paint.h"
#include "sfm/scene/pose_error.h"

namespace samples {
namespace {

constexpr double kLegRadius = 0.2;
constexpr double kGradientStep = 1e-4;
// A signed distance that changes more slowly than this is near an edge inside, where it tells nothing.
constexpr double kLeastSlope = 0.2;
constexpr int kNewtonSteps = 4;
constexpr double kOnSurface = 1e-4;
// Beyond this distance from its bounding ball no solid is the nearest surface of a mesh worth measuring.
constexpr double kBallMargin = 0.15;
constexpr double kPointSpacing = 0.004;  // of the points on the mesh: well below `reach`
constexpr std::size_t kDistanceStride = 16;
constexpr double kTruthCell = 0.02;  // of the lattice of true points
constexpr int kPixelStride = 2;      // of the rays that find them
constexpr int kLeastViews = 2;

double CylinderDistance(const Vec3& p, double radius, double low, double high) {
  const double r = Length(p.x(), p.y()) - radius, h = std::max(low - p.z(), p.z() - high);
  return std::min(std::max(r, h), 0.0) + Length(std::max(r, 0.0), std::max(h, 0.0));
}

// To where Newton's steps along the gradient arrive; the first step's length where they don't.
double SolidDistance(const Solid& solid, const Vec3& p) {
  Vec3 at = p;
  double first = 0;
  for (int i = 0; i < kNewtonSteps; ++i) {
    Vec3 gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 step = kGradientStep * Vec3::Unit(axis);
      gradient[axis] = (solid.distance(at + step) - solid.distance(at - step)) / (2 * kGradientStep);
    }
    const double value = solid.distance(at);
    if (i == 0) first = std::abs(value) / std::max(gradient.norm(), kLeastSlope);
    at -= value / std::max(gradient.squaredNorm(), kLeastSlope * kLeastSlope) * gradient;
  }
  return std::abs(solid.distance(at)) < kOnSurface ? (at - p).norm() : first;
}

const std::vector<Solid>& AllSolids() {
  static const std::vector<Solid> solids = [] {
    std::vector<Solid> all = FigurineSolids();
    for (const Solid& solid : TablewareSolids()) all.push_back(solid);
    return all;
  }();
  return solids;
}

struct Region {
  const char* name;
  bool (*contains)(const Vec3& p);
};
// A mesh of the table top is not one of the things on it while it errs by less than this.
constexpr double kAboveTable = 0.02;
const Region kRegions[] = {
    {"things on the table",
     [](const Vec3& p) { return p.z() > kAboveTable && p.head<2>().norm() < kTableRadius; }},
    {"still life",
     [](const Vec3& p) { return p.z() > -kAboveTable && p.head<2>().norm() < kTableRadius + kAboveTable; }},
    {"all", [](const Vec3&) { return true; }}};

std::int64_t CellOf(const Vec3& p, double side) {
  std::int64_t cell = 0;
  for (int axis = 0; axis < 3; ++axis)
    cell = cell * (1 << 20) + static_cast<std::int64_t>(std::floor(p[axis] / side)) + (1 << 19);
  return cell;
}

// Points spread evenly over the mesh.
std::vector<Vec3> PointsOn(const io::Mesh& mesh, double spacing) {
  std::vector<Vec3> points;
  double area = 0;  // since the last point, in units of spacing^2; starts a new point at 1
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto corner = [&](std::size_t k) -> Vec3 {
      return mesh.positions[mesh.triangles[i][k]].cast<double>();
    };
    const Vec3 a = corner(0), b = corner(1) - a, c = corner(2) - a;
    for (area += 0.5 * b.cross(c).norm() / (spacing * spacing); area >= 1; --area) {
      const auto n = static_cast<std::int64_t>(points.size());
      double u = UnitHash(n, 0, 1), v = UnitHash(n, 1, 1);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      points.push_back(a + u * b + v * c);
    }
  }
  return points;
}

io::Sim3d Align(const io::Scene& train, const std::map<std::string, io::Rigid3d>& true_pose) {
  std::vector<Vec3> centres, true_centres;
  for (const io::Frame& frame : train.frames) {
    const auto pose = true_pose.find(frame.image_path.stem().string());
    if (pose == true_pose.end()) continue;
    centres.push_back(frame.world_from_cam.translation);
    true_centres.push_back(pose->second.translation);
  }
  const std::optional<io::Sim3d> aligned = sfm::AlignCentres(centres, true_centres);
  if (!aligned) {
    throw io::Error(io::ExitCode::kBadInput,
                    std::to_string(centres.size()) + " training views have a true pose, or all on one line",
                    "Give the truth of the same capture");
  }
  return *aligned;
}

// One surface point for each cell of a lattice that enough views see, each from its true pose.
std::vector<Vec3> SeenSurface(const io::Scene& train,
                              const std::map<std::string, io::Rigid3d>& true_pose,
                              int threads) {
  const StillLife scene({.detail = 0.1, .threads = threads});  // only its shape matters
  std::vector<std::unordered_map<std::int64_t, Vec3>> of_view(train.frames.size());
  io::ParallelFor(train.frames.size(), threads, [&](std::size_t i) {
    const io::Frame& frame = train.frames[i];
    const auto pose = true_pose.find(frame.image_path.stem().string());
    if (pose == true_pose.end()) return;
    const io::Camera& camera = train.cameras[static_cast<std::size_t>(frame.camera_index)];
    for (int y = 0; y < camera.height; y += kPixelStride) {
      for (int x = 0; x < camera.width; x += kPixelStride) {
        const Vec3 ray = pose->second.rotation * *io::RayFromImg(camera, {x + 0.5, y + 0.5});
        const Vec3 p = pose->second.translation + scene.Depth(pose->second.translation, ray) * ray;
        of_view[i].emplace(CellOf(p, kTruthCell), p);
      }
    }
  });
  std::map<std::int64_t, std::pair<int, Vec3>> cells;
  for (const auto& view : of_view) {
    for (const auto& [cell, p] : view) ++cells.try_emplace(cell, 0, p).first->second.first;
  }
  std::vector<Vec3> points;
  for (const auto& [cell, seen] : cells) {
    if (seen.first >= kLeastViews) points.push_back(seen.second);
  }
  return points;
}

// Answers whether one of many points lies within a distance.
class NearPoints {
 public:
  NearPoints(const std::vector<Vec3>& points, double reach) : points_(points), reach_(reach) {
    for (std::size_t i = 0; i < points.size(); ++i) cells_[CellOf(points[i], reach)].push_back(i);
  }
  bool Any(const Vec3& p) const {
    for (int i = 0; i < 27; ++i) {
      const Vec3 offset(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      const auto cell = cells_.find(CellOf(p + reach_ * offset, reach_));
      if (cell == cells_.end()) continue;
      for (const std::size_t k : cell->second) {
        if ((points_[k] - p).norm() <= reach_) return true;
      }
    }
    return false;
  }

 private:
  const std::vector<Vec3>& points_;
  const double reach_;
  std::unordered_map<std::int64_t, std::vector<std::size_t>> cells_;
};

}  // namespace

double DistanceToSurface(const Vec3& p) {
  double distance = std::min({std::abs(CylinderDistance(p, kTableRadius, -kTableThickness, 0)),
                              std::abs(CylinderDistance(p, kLegRadius, kFloorZ, -kTableThickness)),
                              std::abs(p.z() - kFloorZ),
                              std::abs(p.z() - kCeilingZ),
                              std::abs(p.head<2>().norm() - kRoomRadius)});
  for (const Solid& solid : AllSolids()) {
    const double to_ball = (p - solid.centre).norm() - solid.radius;
    if (to_ball < kBallMargin) distance = std::min(distance, SolidDistance(solid, p));
  }
  return distance;
}

std::vector<MeshFit> CompareMesh(const io::Mesh& mesh,
                                 const io::Scene& train,
                                 const io::Scene& truth,
                                 const MeshTruthOptions& options) {
  std::map<std::string, io::Rigid3d> true_pose;
  for (const io::Frame& frame : truth.frames)
    true_pose[frame.image_path.stem().string()] = frame.world_from_cam;
  const io::Sim3d truth_from_scene = Align(train, true_pose), scene_from_truth = truth_from_scene.Inverse();
  const std::vector<Vec3> points = PointsOn(io::TransformedMesh(truth_from_scene, mesh), kPointSpacing);
  std::vector<double> distances(points.size() / kDistanceStride);
  io::ParallelFor(distances.size(), options.threads, [&](std::size_t i) {
    distances[i] = DistanceToSurface(points[kDistanceStride * i]);
  });
  const NearPoints near(points, options.reach);
  std::vector<Vec3> seen = SeenSurface(train, true_pose, options.threads);
  // The surface ends at the box: what is nearer to its sides than `reach` may lie beyond.
  const Vec3 margin = Vec3::Constant(options.reach * scene_from_truth.scale);
  std::erase_if(seen, [&](const Vec3& p) {
    const Vec3 at = scene_from_truth * p;
    return ((at - margin).array() < options.box.min.array()).any() ||
           ((at + margin).array() > options.box.max.array()).any();
  });
  std::vector<MeshFit> fits;
  for (const Region& region : kRegions) {
    MeshFit fit{.region = region.name};
    std::vector<double> here;
    for (std::size_t i = 0; i < distances.size(); ++i) {
      if (region.contains(points[kDistanceStride * i])) here.push_back(distances[i]);
    }
    fit.mesh_points = here.size();
    fit.median = io::Median(here);
    fit.q90 = io::Quantile(here, 0.9);
    std::size_t n_near = 0;
    for (const Vec3& p : seen) {
      if (!region.contains(p)) continue;
      ++fit.true_points;
      n_near += near.Any(p);
    }
    fit.share_within =
        static_cast<double>(n_near) / static_cast<double>(std::max<std::size_t>(1, fit.true_points));
    fits.push_back(std::move(fit));
  }
  return fits;
}

}  // namespace samples
