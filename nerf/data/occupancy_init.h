// The occupancy grid before the first training step: what the pictures alone say about empty space.
#pragma once

#include "io/process/parallel.h"
#include "nerf/data/dataset.h"
#include "nerf/sampling/occupancy_grid.h"

namespace nerf {

// Pictures with alpha: the visual hull. A cell is empty when some view sees all of it inside the picture on
// fully transparent pixels (tested on the square that encloses the cell's projection, so thin parts survive).
void CarveByMasks(const io::Scene& scene,
                  const Dataset& dataset,
                  const SceneContraction& contraction,
                  io::Workers* workers,
                  OccupancyGrid* grid);

// Pictures without alpha, or with masks. A cell is empty when it was before, or
//   - fewer than two views see it at a distance beyond `near`, since one view alone cannot tell depth; or
//   - some view sees it nearer than `near`. That view renders nothing there, so nothing keeps a few other
//   views
//     from putting floaters in front of it.
// Only used pixels count as seen: where no training ray passes, the density that cells start with would stay
// as fog.
void CarveByFrusta(const io::Scene& scene,
                   const Dataset& dataset,
                   const SceneContraction& contraction,
                   double near,
                   io::Workers* workers,
                   OccupancyGrid* grid);

}  // namespace nerf
