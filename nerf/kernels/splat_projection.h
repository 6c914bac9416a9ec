// Projection of 3D Gaussians to a picture, and its gradient, after Zwicker, Pfister, van Baar and Gross, "EWA
// splatting", 2002: the covariance goes through the projection's Jacobian at the splat's middle. With
// p = R (place - centre), slopes s = (p_x, p_y) / p_z, their clamped values s' and Q of the unit quaternion,
//   x = fl_x s_x + cx,  y = fl_y s_y + cy,  inverse of (a, b; b, c) = M M^T + low_pass 1,
//   M = J R Q diag(exp(log_scales)),  J = (fl_x, 0, -fl_x s'_x; 0, fl_y, -fl_y s'_y) / p_z,
//   opacity = 1 / (1 + e^-logit),  rgb as in splatting/splats.h.
// Against exact arithmetic, middles err by less than 1e-3 px, all else by less than 1e-4 of its value and
// 1e-5; gradients by 1e-3 of the largest one of their kind (tests/nerf/kernels/splat_projection_test.cpp).
#pragma once

#include <cstdint>

#include "nerf/kernels/splat_blending.h"

namespace nerf::kernels {

inline constexpr int kSplatHarmonics = 4;  // spherical harmonics up to degree 1
inline constexpr double kSplatHarmonic0 = 0.28209479177387814, kSplatHarmonic1 = 0.4886025119029199;

struct SplatCamera {
  float rotation[9];  // cam_from_world, row by row; OpenCV axes, z forward
  float centre[3];
  float fl_x, fl_y, cx, cy;
  float width, height;
  // Of p_x / p_z and p_y / p_z: the projection is linearised where the splat is, or else at these limits.
  float lowest_slope[2], highest_slope[2];
  float low_pass;  // added to variances in the picture [px^2]
  float nearest;   // splats with a smaller p_z are not seen
};

// As in splatting/splats.h.
template <typename Value>
struct SplatArrays {
  Value *places, *log_scales, *rotations, *opacities, *colours;
};

// Splats [first, first + n). A depth p_z of 0: the splat is not seen, for it is too near, behind, beside the
// picture, or too faint; then nothing else is set.
using ProjectSplatsFunction = void (*)(const SplatCamera& camera,
                                       const SplatArrays<const float>& splats,
                                       int first,
                                       int n,
                                       BlendedSplat* blended,
                                       float* depths);

// Sets the rows indices[0 .. n) of `gradients`, of splats that are seen, for by_blended[n].
using ProjectSplatsGradientFunction = void (*)(const SplatCamera& camera,
                                               const SplatArrays<const float>& splats,
                                               const std::uint32_t* indices,
                                               int n,
                                               const BlendedSplatGradient* by_blended,
                                               const SplatArrays<float>& gradients);

}  // namespace nerf::kernels
