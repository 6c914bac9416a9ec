// Distortion loss of one ray [Barron et al. 2022]: light should come from one place, not from fog along the
// way.
//
//   L = sum_i sum_j w_i w_j |s_i - s_j| + 1/3 sum_i w_i^2 d_i
//
// with weights w_i (volume_rendering.h) at places s_i, which must rise, and intervals of length d_i in the
// same measure. Training takes s = log t and d = delta / t: a surface that is blurred over the same share of
// its distance costs the same, near or far.
#pragma once

namespace nerf {

// Returns L of n samples, and d L / d w [n]. Linear in n: |s_i - s_j| is summed by what lies in front and
// behind.
template <typename Scalar>
Scalar Distortion(
    int n, const Scalar* weights, const Scalar* places, const Scalar* lengths, Scalar* weight_gradients) {
  Scalar weight_behind = 0, moment_behind = 0;
  for (int i = 0; i < n; ++i) {
    // Places from the first on, which keeps differences exact where all are far away.
    weight_behind += weights[i], moment_behind += weights[i] * (places[i] - places[0]);
  }
  Scalar weight_before = 0, moment_before = 0, loss = 0;
  for (int i = 0; i < n; ++i) {
    const Scalar w = weights[i], s = places[i] - places[0];
    weight_behind -= w, moment_behind -= w * s;
    weight_gradients[i] = Scalar(2) * (s * (weight_before - weight_behind) + moment_behind - moment_before) +
                          Scalar(2) / Scalar(3) * w * lengths[i];
    weight_before += w, moment_before += w * s;
    loss += w * weight_gradients[i] / Scalar(2);  // L is a quadratic form of the weights
  }
  return loss;
}

}  // namespace nerf
