// Loss of a ray through a sparse point: its light should come from the point's distance d.
//
//   L = sum_i w_i rho(|log(t_i / d)|),   rho rises from 0 at the tolerance to 1 at tolerance + scale
//
// with weights w_i (volume_rendering.h) at distances t_i, infinity included. After Deng et al. 2022, but
// linear in the weights, so that a wrong point costs no more than all of its ray's light. Distances count in
// shares of d, as the errors of triangulated points do.
#pragma once

#include <algorithm>
#include <cmath>

namespace nerf {

// Half of the samples' usual spacing, and the error of a point seen under a few degrees.
inline constexpr float kDepthTolerance = 0.01f;
// Wide enough to pull on a surface that formed at the wrong depth.
inline constexpr float kDepthScale = 0.1f;

// d L / d w of a sample at distance t.
template <typename Scalar>
Scalar DepthPenalty(Scalar t, Scalar depth) {
  const Scalar off = std::fabs(std::log(t / depth));
  return std::clamp((off - Scalar(kDepthTolerance)) / Scalar(kDepthScale), Scalar(0), Scalar(1));
}

}  // namespace nerf
