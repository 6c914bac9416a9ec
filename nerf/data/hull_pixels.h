// Which pixels of pictures with alpha can show anything.
#pragma once

#include "io/process/parallel.h"
#include "nerf/data/dataset.h"
#include "nerf/sampling/scene_contraction.h"

namespace nerf {

// Keeps, of the used pixels, those whose rays can meet a cell of the visual hull (CarveByMasks); the others
// would have no samples and so no gradient. A pixel is dropped when it is transparent and so is everything
// around it, as far as two cells can reach in that view. On Lego that is half of the pixels.
void DropPixelsBesideHull(const io::Scene& scene,
                          const SceneContraction& contraction,
                          int grid_resolution,
                          io::Workers* workers,
                          Dataset* dataset);

}  // namespace nerf
