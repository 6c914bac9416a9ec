#include "sfm/bundle/observation_filter.h"

#include <cmath>
#include <numbers>

namespace sfm {
namespace {

// COLMAP's own limits for an observation and for a point of its models.
constexpr double kMaxErrorPx = 4.0;
constexpr double kMinAngleDeg = 1.5;
constexpr std::size_t kMinObservations = 2;

// Reprojection error; infinite behind the camera.
double ErrorPx(const io::Scene& scene, const io::Observation& observation) {
  const auto projected = io::Project(scene, observation);
  return projected ? (*projected - observation.xy).norm() : HUGE_VAL;
}

double WidestAngleDeg(const io::Scene& scene,
                      const Eigen::Vector3d& xyz,
                      const std::vector<io::Observation>& observations) {
  std::vector<Eigen::Vector3d> rays;
  for (const io::Observation& observation : observations) {
    const auto frame = static_cast<std::size_t>(observation.frame_index);
    rays.push_back(scene.frames[frame].world_from_cam.translation - xyz);
  }
  double widest = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    for (std::size_t j = i + 1; j < rays.size(); ++j) {
      widest = std::max(widest, std::atan2(rays[i].cross(rays[j]).norm(), rays[i].dot(rays[j])));
    }
  }
  return widest * 180 / std::numbers::pi;
}

}  // namespace

FilterReport RemoveWeakObservations(io::ColmapModel* model) {
  io::Scene& scene = model->scene;
  std::vector<std::vector<io::Observation>> tracks(scene.points.size());
  for (const io::Observation& observation : model->observations) {
    if (ErrorPx(scene, observation) <= kMaxErrorPx) {
      tracks[static_cast<std::size_t>(observation.point_index)].push_back(observation);
    }
  }
  FilterReport report{.removed_observations = static_cast<int>(model->observations.size()),
                      .removed_points = static_cast<int>(scene.points.size())};
  std::vector<io::Point3D> points;
  std::vector<io::Observation> observations;
  double error_sum = 0, square_sum = 0;
  for (std::size_t i = 0; i < scene.points.size(); ++i) {
    if (tracks[i].size() < kMinObservations ||
        WidestAngleDeg(scene, scene.points[i].xyz, tracks[i]) < kMinAngleDeg) {
      continue;
    }
    io::Point3D point = scene.points[i];
    point.frame_indices.clear();
    point.error_px = 0;
    for (io::Observation observation : tracks[i]) {
      const double error = ErrorPx(scene, observation);
      point.error_px += error / static_cast<double>(tracks[i].size());
      error_sum += error, square_sum += error * error;
      point.frame_indices.push_back(observation.frame_index);
      observation.point_index = static_cast<int>(points.size());
      observations.push_back(observation);
    }
    points.push_back(std::move(point));
  }
  scene.points = std::move(points);
  model->observations = std::move(observations);
  const double n = static_cast<double>(model->observations.size());
  report.removed_observations -= static_cast<int>(model->observations.size());
  report.removed_points -= static_cast<int>(scene.points.size());
  report.rms_px = n > 0 ? std::sqrt(square_sum / n) : 0;
  model->mean_reprojection_error_px = n > 0 ? error_sum / n : 0;
  model->mean_track_length = n > 0 ? n / static_cast<double>(scene.points.size()) : 0;
  return report;
}

}  // namespace sfm
