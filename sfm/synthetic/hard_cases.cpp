#include "sfm/synthetic/hard_cases.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/process/process.h"
#include "io/process/resource_meter.h"
#include "sfm/reconstruction.h"
#include "sfm/scene/doming.h"
#include "sfm/synthetic/synthetic_capture.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

// Relative error of the focal length of the worst camera that took a registered picture.
double FocalError(const io::Scene& estimated, const io::Scene& truth) {
  std::map<std::string, double> focal;
  for (const io::Frame& frame : truth.frames)
    focal[frame.image_path.string()] = truth.cameras[static_cast<std::size_t>(frame.camera_index)].fl_x;
  double worst = 0;
  for (const io::Frame& frame : estimated.frames) {
    const double f = estimated.cameras[static_cast<std::size_t>(frame.camera_index)].fl_x;
    worst = std::max(worst, std::abs(f / focal.at(frame.image_path.string()) - 1));
  }
  return worst;
}

int PointsBehindCameras(const io::Scene& scene) {
  return static_cast<int>(
      std::count_if(scene.points.begin(), scene.points.end(), [&](const io::Point3D& point) {
        return std::any_of(point.frame_indices.begin(), point.frame_indices.end(), [&](int frame) {
          const io::Rigid3d& pose = scene.frames[static_cast<std::size_t>(frame)].world_from_cam;
          return !((pose.Inverse() * point.xyz).z() < 0);
        });
      }));
}

// Of the points that the capture and the model share. The keypoints of a picture begin with the true points
// that it sees, in their order.
double DomingOf(const io::ColmapModel& model, const SyntheticCapture& capture) {
  std::vector<std::vector<std::size_t>> seen(capture.pictures.size());
  for (std::size_t p = 0; p < capture.truth.points.size(); ++p) {
    for (const int frame : capture.truth.points[p].frame_indices)
      seen[static_cast<std::size_t>(frame)].push_back(p);
  }
  std::map<std::string, std::size_t> picture;
  for (std::size_t i = 0; i < capture.pictures.size(); ++i) picture[capture.pictures[i].name] = i;
  std::vector<Eigen::Vector3d> estimated, truth;
  int previous = -1;
  for (const io::Observation& o : model.observations) {
    if (o.point_index == previous) continue;
    previous = o.point_index;
    const io::Frame& frame = model.scene.frames[static_cast<std::size_t>(o.frame_index)];
    const std::size_t i = picture.at(frame.image_path.string());
    const auto squared_distance = [&](std::size_t k) {
      const Keypoint& at = capture.features[i].keypoints[k];
      return (o.xy - Eigen::Vector2d(at.x, at.y)).squaredNorm();
    };
    std::size_t nearest = 0;
    for (std::size_t k = 1; k < seen[i].size(); ++k) {
      if (squared_distance(k) < squared_distance(nearest)) nearest = k;
    }
    estimated.push_back(model.scene.points[static_cast<std::size_t>(o.point_index)].xyz);
    truth.push_back(capture.truth.points[seen[i][nearest]].xyz);
  }
  return Doming(estimated, truth);
}

bool IsGoodModel(const HardCase& limits, const HardCaseResult& result) {
  return result.registered >= limits.min_registered_share * result.pictures &&
         result.error.rotation_max_deg <= limits.max_rotation_deg &&
         (std::isnan(result.error.centre_rmse) || result.error.centre_rmse <= limits.max_centre) &&
         (limits.max_focal_error == 0 || result.focal_error <= limits.max_focal_error) &&
         (limits.camera_model.empty() || result.camera_model == limits.camera_model) &&
         (limits.max_doming == 0 || result.doming <= limits.max_doming) && result.points_behind == 0;
}

void Reconstruct(const SyntheticCapture& capture,
                 const fs::path& work_folder,
                 int threads,
                 HardCaseResult* result) {
  try {
    const Reconstruction found = ReconstructMatches(capture.pictures,
                                                    capture.features,
                                                    capture.matches,
                                                    work_folder,
                                                    {.camera_model = "auto", .threads = threads},
                                                    [](const std::string&) {});
    const io::Scene& scene = found.model.scene;
    result->registered = static_cast<int>(scene.frames.size());
    result->error = ComparePoses(scene, capture.truth);
    result->focal_error = FocalError(scene, capture.truth);
    result->doming = DomingOf(found.model, capture);
    result->points_behind = PointsBehindCameras(scene);
    result->camera_model = found.model.camera_model;
  } catch (const NotReconstructible& error) {
    result->refusal = error.refusal();
  } catch (const io::Error& error) {
    result->failure = error.what();
  }
}

}  // namespace

bool Passes(const HardCase& limits, const HardCaseResult& result) {
  if (!result.failure.empty()) return false;
  if (result.refusal) return limits.expectation != Expectation::kModel;
  return limits.expectation != Expectation::kRefusal && IsGoodModel(limits, result);
}

bool IsFolded(const HardCaseResult& result) {
  return !result.refusal && result.failure.empty() && !(result.error.rotation_max_deg <= kFoldedDeg);
}

HardCaseResult RunHardCase(const HardCase& hard_case,
                           std::uint64_t seed,
                           const fs::path& work_folder,
                           int threads) {
  if (!io::FindProgram("colmap")) {
    throw io::Error(io::ExitCode::kMissingTool, "colmap: not found on PATH", "Run: apt-get install colmap");
  }
  CaptureOptions options = hard_case.options;
  options.seed = seed;
  const SyntheticCapture capture = MakeSyntheticCapture(options);
  HardCaseResult result{.pictures = static_cast<int>(capture.pictures.size())};
  io::RecreateOwnedFolder(work_folder);
  const io::ResourceMeter meter;
  Reconstruct(capture, work_folder, threads, &result);
  result.wall_s = meter.Use().wall_s;
  result.cpu_s = meter.Use().cpu_s;
  io::RemoveOwnedFolder(work_folder);
  return result;
}

}  // namespace sfm
