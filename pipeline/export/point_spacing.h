// How far apart points of a surface lie, each among its neighbours.
#pragma once

#include <vector>

#include "pipeline/export/surfel_grid.h"

namespace pipeline {

// The side of the square of surface that a point has for itself: r sqrt(pi / k), with r the distance to its
// k-th neighbour, k = 8 where there are as many. 0 for a point alone.
std::vector<double> PointSpacing(const std::vector<Surfel>& surfels);

}  // namespace pipeline
