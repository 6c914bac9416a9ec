// Emission-absorption quadrature along one ray, and the loss with its exact derivatives.
//
//   optical depth  tau_i = sigma_i delta_i            alpha_i = -expm1(-tau_i)
//   transmittance  T_i = exp(-sum_{j<i} tau_j)        weights w_i = T_i alpha_i
//   colour         C = sum w_i c_i,  T_end = exp(-sum tau_j) shows the background
//
// [Max 1995; Mildenhall et al. 2020.] T is accumulated in log space, so neither products near 0 nor 1 - alpha
// = 0 need care. Templated on the scalar: float in training, double as the oracle of the tests.
//
// Loss. A picture with alpha A* and premultiplied colour C* must look right on every background. For a
// background b_j uniform in [0, 1] per channel the expected squared error has the closed form, with D = T_end
// - (1 - A*) and e_j = C_j - C*_j + D / 2,
//   E 1/2 sum_j (C_j - C*_j + b_j D)^2 = 1/2 sum_j e_j^2 + 1/8 D^2,
// so no background needs to be drawn. Opaque pictures are the case A* = 1: light that leaves the scene is an
// error.
#pragma once

#include <cmath>

namespace nerf {

// Light below this share is not followed: at most 1e-4 of full scale, 0.03 of an 8-bit step.
inline constexpr float kEarlyStopTransmittance = 1e-4f;

struct PixelTarget {
  float premultiplied[3];
  float alpha;
};

// Transmittance before each of n samples and at the end, from optical depths. Returns T_end.
template <typename Scalar>
Scalar Transmittance(int n, const Scalar* tau, Scalar* transmittance) {
  Scalar depth = 0;
  for (int i = 0; i < n; ++i) {
    transmittance[i] = std::exp(-depth);
    depth += tau[i];
  }
  return std::exp(-depth);
}

// One ray: weights [n], rgb [n][3] and T_end give the loss; outputs d loss / d rgb-logits [n][3] (rgb =
// sigmoid(logit)) and d loss / d log sigma [n], both times `scale`:
//   d loss / d log sigma_i = tau_i (T_{i+1} q_i - sum_{k>i} w_k q_k - G T_end),  q_i = sum_j e_j c_ij,
//   G = d loss / d T_end = D / 4 + 1/2 sum_j e_j.
// Returns the loss, unscaled; squared_error receives sum_j (C_j + D/2 - C*_j)^2, the error on a grey
// background.
template <typename Scalar>
Scalar CompositeLoss(int n,
                     const Scalar* tau,
                     const Scalar* weights,
                     const Scalar* rgb,
                     Scalar transmittance_end,
                     const PixelTarget& target,
                     Scalar scale,
                     Scalar* logit_gradients,
                     Scalar* log_sigma_gradients,
                     Scalar* squared_error) {
  Scalar error[3];
  const Scalar leak = transmittance_end - (Scalar(1) - Scalar(target.alpha));
  for (int j = 0; j < 3; ++j) error[j] = Scalar(0.5) * leak - Scalar(target.premultiplied[j]);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < 3; ++j) error[j] += weights[i] * rgb[3 * i + j];
  }
  const Scalar squared = error[0] * error[0] + error[1] * error[1] + error[2] * error[2];
  const Scalar end_gradient = leak / Scalar(4) + (error[0] + error[1] + error[2]) / Scalar(2);

  // T_{i+1} is rebuilt from the back: T_i = T_{i+1} + w_i. `behind` collects what lies behind sample i.
  Scalar behind = end_gradient * transmittance_end, after = transmittance_end;
  for (int i = n - 1; i >= 0; --i) {
    const Scalar* c = rgb + 3 * i;
    const Scalar q = error[0] * c[0] + error[1] * c[1] + error[2] * c[2];
    log_sigma_gradients[i] = scale * tau[i] * (after * q - behind);
    for (int j = 0; j < 3; ++j) {
      logit_gradients[3 * i + j] = scale * weights[i] * error[j] * c[j] * (Scalar(1) - c[j]);
    }
    behind += weights[i] * q;
    after += weights[i];
  }
  *squared_error = squared;
  return squared / Scalar(2) + leak * leak / Scalar(8);
}

}  // namespace nerf
