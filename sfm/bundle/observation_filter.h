// Takes out of an adjusted model what does not agree with it, and states how well the rest does.
#pragma once

#include "io/scene/colmap_model.h"

namespace sfm {

struct FilterReport {
  int removed_observations = 0, removed_points = 0;
  double rms_px = 0;  // reprojection error of the observations that stay
};

// Removes observations with an error above 4 px or of a point behind the camera, then points with fewer than
// 2 observations or whose rays diverge by less than 1.5 degrees at most. Recomputes the errors of points and
// model and the mean track length.
FilterReport RemoveWeakObservations(io::ColmapModel* model);

}  // namespace sfm
