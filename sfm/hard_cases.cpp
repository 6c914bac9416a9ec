#include "sfm/hard_cases.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "io/error.h"
#include "io/process.h"
#include "io/resource_meter.h"
#include "sfm/reconstruction.h"
#include "sfm/synthetic_capture.h"

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

bool IsGoodModel(const HardCase& limits, const HardCaseResult& result) {
  return result.registered >= limits.min_registered_share * result.pictures &&
         result.error.rotation_max_deg <= limits.max_rotation_deg &&
         (std::isnan(result.error.centre_rmse) || result.error.centre_rmse <= limits.max_centre) &&
         (limits.max_focal_error == 0 || result.focal_error <= limits.max_focal_error) &&
         (limits.camera_model.empty() || result.camera_model == limits.camera_model) &&
         result.points_behind == 0;
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
    result->points_behind = PointsBehindCameras(scene);
    result->camera_model = found.model.camera_model;
  } catch (const io::Error& error) {
    (error.code() == io::ExitCode::kNotReconstructible ? result->refusal : result->failure) = error.what();
  }
}

}  // namespace

bool Passes(const HardCase& limits, const HardCaseResult& result) {
  if (!result.failure.empty()) return false;
  if (!result.refusal.empty()) return limits.expectation != Expectation::kModel;
  return limits.expectation != Expectation::kRefusal && IsGoodModel(limits, result);
}

bool IsFolded(const HardCaseResult& result) {
  return result.refusal.empty() && result.failure.empty() && !(result.error.rotation_max_deg <= kFoldedDeg);
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
  fs::remove_all(work_folder);
  const io::ResourceMeter meter;
  Reconstruct(capture, work_folder, threads, &result);
  result.wall_s = meter.Use().wall_s;
  result.cpu_s = meter.Use().cpu_s;
  fs::remove_all(work_folder);
  return result;
}

}  // namespace sfm
