// Keeps the film's path in space that the trained field and its splats leave free and the training pictures
// have seen.
#pragma once

#include "nerf/paths/camera_path.h"
#include "nerf/rendering/support_map.h"

namespace nerf {

struct FreePathReport {
  int checked = 0;     // poses of the path that were rendered, small
  int obstructed = 0;  // of these: something stood before the camera, or too much was never observed
  int remaining = 0;   // still, after the path was drawn to the cameras
};

// Renders the path small. Where something is closer before the camera, or more was not observed, than in
// nearly all training views, the path is drawn towards the training cameras, gradually along the path, and
// left as it was where that does not help. Also finds the depths of the path (even_path.h). A drawn path is
// to be timed anew.
FreePathReport KeepFree(const TrainedField& field,
                        const io::Scene& train,
                        const SupportMap& support,
                        int threads,
                        CameraPath* path);

}  // namespace nerf
