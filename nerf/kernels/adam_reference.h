// The plain reference of the optimisers' kernels.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "nerf/kernels/kernels.h"

namespace nerf::kernels::reference {

template <typename Scalar>
void Adam(const AdamStep& step, std::size_t n, Scalar* gradients, Scalar* m, Scalar* v, Scalar* values) {
  for (std::size_t i = 0; i < n; ++i) {
    const Scalar g = gradients[i];
    gradients[i] = 0;
    if (g == 0) continue;
    m[i] = Scalar(step.beta1) * m[i] + (1 - Scalar(step.beta1)) * g;
    v[i] = Scalar(step.beta2) * v[i] + (1 - Scalar(step.beta2)) * g * g;
    values[i] -= Scalar(step.learning_rate) * m[i] * Scalar(step.correction1) /
                 (std::sqrt(v[i] * Scalar(step.correction2)) + Scalar(step.epsilon));
  }
}

template <typename Scalar>
void StepEntries(const AdamStep& step, std::size_t n, Scalar* gradients, Scalar* v, Scalar* values) {
  for (std::size_t e = 0; e < n; ++e) {
    Scalar* g = gradients + e * kFeatures;
    Scalar mean_square = 0;
    for (int f = 0; f < kFeatures; ++f) mean_square += g[f] * g[f] / kFeatures;
    if (mean_square != 0) {
      v[e] = Scalar(step.beta2) * v[e] + (1 - Scalar(step.beta2)) * mean_square;
      const Scalar root = std::sqrt(v[e] * Scalar(step.correction2)) + Scalar(step.epsilon);
      for (std::size_t f = 0; f < kFeatures; ++f)
        values[e * kFeatures + f] -= Scalar(step.learning_rate) * g[f] / root;
    }
    std::fill_n(g, kFeatures, Scalar(0));
  }
}

}  // namespace nerf::kernels::reference
