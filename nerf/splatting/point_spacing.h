// How far apart points of a surface lie, each among its neighbours.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace nerf {

// The side of the square of surface that a point has for itself: r sqrt(pi / k), with r the distance to its
// k-th neighbour, k = 8 where there are as many. 0 for a point alone. Throws io::Interrupted.
std::vector<double> PointSpacing(const std::vector<Eigen::Vector3f>& points);

}  // namespace nerf
