// The surface of a trained field as oriented, coloured points: what its training views show, where at least
// two of them agree on it.
#pragma once

#include <vector>

#include "pipeline/export/exported_scene.h"
#include "pipeline/export/surfel_grid.h"

namespace pipeline {

struct SurfaceOptions {
  int view_size = 512;       // longer side of the rendered views [px]; 0: that of the training pictures
  int max_points = 1000000;  // thinned to at most so many
};

// In scene coordinates. Needs scene.field. Throws kBadState when no two views agree on anything, and
// io::Interrupted.
std::vector<Surfel> DenseSurface(const ExportedScene& scene, const SurfaceOptions& options);

}  // namespace pipeline
