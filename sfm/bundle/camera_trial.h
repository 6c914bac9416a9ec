// One adjustment with some of the intrinsics free, and what it says about each of them.
#pragma once

#include <string>
#include <vector>

#include "sfm/bundle/camera_models.h"
#include "sfm/bundle/observation_split.h"

namespace sfm {

struct CameraTrial {
  std::vector<FreeIntrinsics> free;    // per camera
  io::Scene scene;                     // adjusted; without points
  std::vector<IntrinsicVector> sigma;  // standard deviations, per camera
  double held_out_px = 0;              // error of observations that the adjustment did not use
};

// Adjusts the training part, from the values it comes with: a start that too simple a camera has warped could
// lead elsewhere.
CameraTrial RunTrial(const ObservationSplit& split, const std::vector<FreeIntrinsics>& free);

// `start` is the scene that the trial began with; `camera` an index of its cameras.

// Whether the trial determines what the extension adds to the camera, and finds it to differ from its value
// without: by more than 3 standard deviations in each parameter, or in one coordinate of the principal point.
bool IsSignificant(const CameraExtension& extension,
                   const CameraTrial& trial,
                   const io::Scene& start,
                   std::size_t camera);

// The same in figures: ", camera 0 k1 -0.05 +- 0.001".
std::string Figures(const CameraExtension& extension,
                    const CameraTrial& trial,
                    const io::Scene& start,
                    std::size_t camera);

// How far a focal length per picture lies from the shared one, in standard deviations (root mean square over
// the cameras that the observations determine). shared_camera[i]: the camera of `shared` that camera i of
// `own` was split from.
double FocalSpread(const CameraTrial& own,
                   const CameraTrial& shared,
                   const std::vector<std::size_t>& shared_camera);

}  // namespace sfm
