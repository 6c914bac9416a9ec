// The occupancy grid before the first training step: what the pictures alone say about empty space.
#pragma once

#include "io/base/parallel.h"
#include "nerf/data/dataset.h"
#include "nerf/sampling/occupancy_grid.h"

namespace nerf {

// Pictures with alpha: the visual hull. A cell is empty when some view sees all of it inside the picture on
// fully transparent pixels (tested on the square that encloses the cell's projection, so thin parts survive).
// Returns the smallest box, in unit coordinates, that holds all other cells: min x, y, z, max x, y, z.
std::array<float, 6> CarveByMasks(const io::Scene& scene,
                                  const Dataset& dataset,
                                  const SceneContraction& contraction,
                                  io::Workers* workers,
                                  OccupancyGrid* grid);

// Opaque pictures: cells that fewer than two views see at distances beyond `near` are empty (one view cannot
// place anything in depth), and so are cells that lie in some view's picture and nearer than `near`: this
// view looks through what other views, a few of them mostly, would put there. Views see through their used
// pixels: elsewhere training never meets the density that a cell starts with, which would stay as fog.
void CarveByFrusta(const io::Scene& scene,
                   const Dataset& dataset,
                   const SceneContraction& contraction,
                   double near,
                   io::Workers* workers,
                   OccupancyGrid* grid);

}  // namespace nerf
