// A camera per picture instead of one for many.
#pragma once

#include <cstddef>
#include <vector>

#include "io/scene/scene.h"

namespace sfm {

struct CameraSplit {
  std::vector<std::size_t> shared_camera;  // which each new camera came from
  std::vector<int> lens_of;                // see FreeIntrinsics: the first of those that shared a camera
};

// Gives every frame, in order, a copy of its camera.
CameraSplit SplitCameras(io::Scene* scene);

}  // namespace sfm
