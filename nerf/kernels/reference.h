// The plain reference of every kernel in kernels.h: the shortest correct loops, templated on the scalar
// (double: the oracle of the tests). Layouts and meanings are those of kernels.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "nerf/kernels/bf16.h"
#include "nerf/kernels/hash_grid_reference.h"
#include "nerf/kernels/kernels.h"

namespace nerf::kernels::reference {

template <typename Scalar>
void Matmul(
    int n, int k, int m, const Scalar* x, const Scalar* w, Epilogue epilogue, const Scalar* mask, Scalar* y) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) {
      Scalar sum = 0;
      for (int l = 0; l < k; ++l) sum += x[i * k + l] * w[l * m + j];
      if (epilogue == Epilogue::kRelu && sum < 0) sum = 0;
      if (epilogue == Epilogue::kMask && !(mask[i * m + j] > 0)) sum = 0;
      y[i * m + j] = sum;
    }
  }
}

template <typename Scalar>
void MatmulGradient(int n, int k, int m, const Scalar* x, const Scalar* y_gradient, Scalar* w_gradient) {
  for (int i = 0; i < n; ++i) {
    for (int l = 0; l < k; ++l) {
      for (int j = 0; j < m; ++j) w_gradient[l * m + j] += x[i * k + l] * y_gradient[i * m + j];
    }
  }
}

template <typename Scalar>
void Head(int n, int k, const Scalar* x, const Scalar* w, Scalar* logits) {
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < 3; ++c) {
      logits[3 * i + c] = 0;
      for (int j = 0; j < k; ++j) logits[3 * i + c] += x[i * k + j] * w[c * k + j];
    }
  }
}

template <typename Scalar>
void HeadGradient(int n,
                  int k,
                  const Scalar* x,
                  const Scalar* w,
                  const Scalar* logit_gradients,
                  Scalar* x_gradient,
                  Scalar* w_gradient) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < k; ++j) {
      Scalar sum = 0;
      for (int c = 0; c < 3; ++c) {
        sum += logit_gradients[3 * i + c] * w[c * k + j];
        w_gradient[c * k + j] += logit_gradients[3 * i + c] * x[i * k + j];
      }
      x_gradient[i * k + j] = x[i * k + j] > 0 ? sum : 0;
    }
  }
}

}  // namespace nerf::kernels::reference
