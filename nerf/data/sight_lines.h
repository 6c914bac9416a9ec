// Empty space from sparse points: what lies between a camera and a point that it observed is transparent.
#pragma once

#include <cstddef>

#include "io/process/parallel.h"
#include "io/scene/scene.h"
#include "nerf/sampling/occupancy_grid.h"

namespace nerf {

// Presumes the cells empty that sight lines cross: from a camera to each point that it observed, and from
// between two cameras that observe the point from similar directions, since the view of it stays free on the
// way from one to the other. Without these, what neighbouring cameras show as their background may be painted
// right before a camera between them.
//
// A line is three cells wide and ends before the point, whose depth is uncertain. Cells at a point and beside
// it stay, whatever crosses them: there is a surface. A point may have been matched wrongly, and its lines
// then cut through surfaces: a cell is free when lines to points of three groups cross it, of 16 into which
// they are dealt out. Plain surfaces have no points: lines past their edge and from between cameras cut them,
// so they may grow back (OccupancyGrid::Settle). Only points with three observers or more count: two rays
// always meet. Points whose observers are unknown say nothing. Returns the number of lines.
std::size_t CarveBySightLines(const io::Scene& scene,
                              const SceneContraction& contraction,
                              io::Workers* workers,
                              OccupancyGrid* grid);

}  // namespace nerf
