// Points for cameras that stay where they are.
#pragma once

#include "io/scene/colmap_model.h"

namespace sfm {

// Moves every point to the minimum, near by, of its own share of the cost of bundle adjustment
// (sfm/bundle/bundle_adjustment.h): Levenberg-Marquardt in three unknowns. Returns whether all of them lie in
// front of the cameras that observe them. The result does not depend on `threads`.
bool AdjustPoints(io::ColmapModel* model, int threads);

}  // namespace sfm
