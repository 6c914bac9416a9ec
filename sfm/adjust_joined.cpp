#include "sfm/adjust_joined.h"

#include <algorithm>

#include "sfm/bundle/bundle_adjustment.h"
#include "sfm/bundle/camera_models.h"
#include "sfm/bundle/observation_split.h"

namespace sfm {
namespace {

// Parts lie a few pixels apart at most; what is farther off is a mismatch, and one behind a camera cannot be
// adjusted at all.
constexpr double kMaxErrorShare = 0.02;  // of the longer side
// Points are triangulated anew afterwards, within COLMAP's 4 pixels, and all is adjusted to the end later.
constexpr double kTolerance = 1e-3;
constexpr int kIterations = 20;

bool IsGross(const io::Scene& scene, const io::Observation& observation) {
  const io::Frame& frame = scene.frames[static_cast<std::size_t>(observation.frame_index)];
  const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
  const auto xy = io::Project(scene, observation);
  return !xy || (*xy - observation.xy).norm() > kMaxErrorShare * std::max(camera.width, camera.height);
}

// Moves the cameras of `model` so that the observations of `part` fit.
void AdjustCameras(io::ColmapModel part, io::ColmapModel* model) {
  std::erase_if(part.observations, [&](const io::Observation& o) { return IsGross(part.scene, o); });
  AdjustBundle(&part,
               {.free = std::vector(part.scene.cameras.size(), FreeParametersOf(model->camera_model)),
                .max_iterations = kIterations,
                .function_tolerance = kTolerance});
  model->scene.cameras = std::move(part.scene.cameras);
  model->scene.frames = std::move(part.scene.frames);
}

}  // namespace

void AdjustJoined(io::ColmapModel* model) { AdjustCameras(SplitObservations(*model, 0).training, model); }

void AdjustBridged(io::ColmapModel* model) { AdjustCameras(*model, model); }

}  // namespace sfm
