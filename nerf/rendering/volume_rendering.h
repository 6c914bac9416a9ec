// Emission-absorption quadrature along one ray, and the loss with its exact derivatives.
//
//   optical depth  tau_i = sigma_i delta_i            alpha_i = -expm1(-tau_i)
//   transmittance  T_i = exp(-sum_{j<i} tau_j)        weights w_i = T_i alpha_i
//   colour         C = sum w_i c_i,  T_end = exp(-sum tau_j) shows the background
//
// [Max 1995; Mildenhall et al. 2020.] T is accumulated in log space, so neither products near 0 nor 1 - alpha
// = 0 need care. Templated on the scalar: float in training, double as the oracle of the tests.
//
// Losses of a pixel with alpha A* and premultiplied colour C*, with D = T_end - (1 - A*):
//   random background   It must look right on every background. For b_j uniform in [0, 1] per channel the
//                       expected squared error has a closed form, with e_j = C_j - C*_j + D / 2,
//                         E 1/2 sum_j (C_j - C*_j + b_j D)^2 = 1/2 sum_j e_j^2 + 1/8 D^2,
//                       so none needs to be drawn. Opaque pictures are the case A* = 1: light that leaves the
//                       scene is an error.
//   fixed background    mean over channels of (C_j - C*_j + b_j D)^2, the report's loss with b = 1. Also for
//                       pixels that have some plain background in them (plain_background.h): A* = 1.
#pragma once

#include <cmath>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "fast-math hides NaN and infinity from every check of the training: build without it"
#endif

namespace nerf {

// Light below this share is not followed: at most 1e-4 of full scale, 0.03 of an 8-bit step.
inline constexpr float kEarlyStopTransmittance = 1e-4f;

struct PixelTarget {
  float premultiplied[3];
  float alpha;
  const float* background = nullptr;  // [3], of the fixed background; null: random
};

// Opacities of n samples alone. kernels::Kernels::one_minus_exp_neg is the fast version.
template <typename Scalar>
void Opacities(int n, const Scalar* tau, Scalar* opacities) {
  for (int i = 0; i < n; ++i) opacities[i] = -std::expm1(-tau[i]);
}

// Turns the opacities of n samples of a ray, in `weights`, into their weights. Returns T_end.
template <typename Scalar>
Scalar WeightsFromOpacities(int n, const Scalar* tau, Scalar* weights) {
  Scalar depth = 0, transmittance = 1;
  for (int i = 0; i < n; ++i) {
    weights[i] *= transmittance;
    depth += tau[i];
    transmittance = std::exp(-depth);
  }
  return transmittance;
}

// The loss of one pixel and its derivatives.
template <typename Scalar>
struct PixelLoss {
  Scalar loss;
  Scalar squared_error;       // sum over channels, on a grey background or the fixed one
  Scalar colour_gradient[3];  // d loss / d C, light of the scene alone
  Scalar end_gradient;        // d loss / d T_end
};

template <typename Scalar>
PixelLoss<Scalar> RandomBackgroundLoss(const Scalar colour[3],
                                       Scalar transmittance_end,
                                       const PixelTarget& target) {
  const Scalar leak = transmittance_end - (Scalar(1) - Scalar(target.alpha));
  PixelLoss<Scalar> result = {};
  for (int j = 0; j < 3; ++j) {
    const Scalar error = colour[j] + (Scalar(0.5) * leak - Scalar(target.premultiplied[j]));
    result.colour_gradient[j] = error;
    result.squared_error += error * error;
    result.end_gradient += error / Scalar(2);
  }
  result.end_gradient += leak / Scalar(4);
  result.loss = result.squared_error / Scalar(2) + leak * leak / Scalar(8);
  return result;
}

template <typename Scalar>
PixelLoss<Scalar> FixedBackgroundLoss(const Scalar colour[3],
                                      Scalar transmittance_end,
                                      const PixelTarget& target,
                                      const float background[3]) {
  const Scalar leak = transmittance_end - (Scalar(1) - Scalar(target.alpha));
  PixelLoss<Scalar> result = {};
  for (int j = 0; j < 3; ++j) {
    const Scalar b = Scalar(background[j]), error = colour[j] - Scalar(target.premultiplied[j]) + b * leak;
    result.colour_gradient[j] = Scalar(2) / Scalar(3) * error;
    result.end_gradient += b * result.colour_gradient[j];
    result.squared_error += error * error;
  }
  result.loss = result.squared_error / Scalar(3);
  return result;
}

template <typename Scalar>
PixelLoss<Scalar> LossOf(const Scalar colour[3], Scalar transmittance_end, const PixelTarget& target) {
  return target.background ? FixedBackgroundLoss(colour, transmittance_end, target, target.background)
                           : RandomBackgroundLoss(colour, transmittance_end, target);
}

// C = sum w_i c_i of n samples with rgb [n][3].
template <typename Scalar>
void CompositeColour(int n, const Scalar* weights, const Scalar* rgb, Scalar colour[3]) {
  for (int j = 0; j < 3; ++j) colour[j] = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < 3; ++j) colour[j] += weights[i] * rgb[3 * i + j];
  }
}

// From the loss of a pixel to its samples: rgb_gradients [n][3] = d loss / d c and tau_gradients [n] =
// d loss / d tau, both times `scale`. With e = colour_gradient and G = end_gradient,
//   d loss / d c_ij = w_i e_j      d loss / d tau_i = T_{i+1} q_i - sum_{k>i} w_k q_k - G T_end,  q_i = sum_j
//   e_j c_ij.
// weight_gradients [n]: what else the loss gains per weight, added to q_i; null: nothing.
template <typename Scalar>
void CompositeGradients(int n,
                        const Scalar* weights,
                        const Scalar* rgb,
                        Scalar transmittance_end,
                        const PixelLoss<Scalar>& pixel,
                        Scalar scale,
                        Scalar* rgb_gradients,
                        Scalar* tau_gradients,
                        const Scalar* weight_gradients = nullptr) {
  const Scalar* e = pixel.colour_gradient;
  // T_{i+1} is rebuilt from the back: T_i = T_{i+1} + w_i. `behind` collects what lies behind sample i.
  Scalar behind = pixel.end_gradient * transmittance_end, after = transmittance_end;
  for (int i = n - 1; i >= 0; --i) {
    const Scalar* c = rgb + 3 * i;
    Scalar q = e[0] * c[0] + e[1] * c[1] + e[2] * c[2];
    if (weight_gradients) q += weight_gradients[i];
    tau_gradients[i] = scale * (after * q - behind);
    for (int j = 0; j < 3; ++j) rgb_gradients[3 * i + j] = scale * weights[i] * e[j];
    behind += weights[i] * q;
    after += weights[i];
  }
}

}  // namespace nerf
