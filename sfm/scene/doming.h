// How far a reconstructed ground bulges: pictures that all look straight down hold a distortion that the
// camera lacks, or has too much of, against a ground bent into a bowl.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace sfm {

// d of h = a + b u + c v + d (u^2 + v^2), fitted by least squares to the heights h of the aligned estimated
// points over the true ones, along the normal of the true points' plane. u, v in the plane and h are over the
// extent, the largest distance of a true point from their mean: |d| is how far the rim bulges. Points of
// equal index belong together. NaN for fewer than four points or where they are collinear.
double Doming(const std::vector<Eigen::Vector3d>& estimated, const std::vector<Eigen::Vector3d>& truth);

}  // namespace sfm
