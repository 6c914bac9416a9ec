// The plain reference of every kernel in kernels.h: the shortest correct loops, templated on the scalar
// (double: the oracle of the tests). Layouts and meanings are those of kernels.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "nerf/kernels/bf16.h"
#include "nerf/kernels/kernels.h"

namespace nerf::kernels::reference {

// Entry and trilinear weight of corner c = 0..7 (x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)) of the cell
// that holds the position.
template <typename Scalar>
void Corner(const GridLevel& level, Scalar x, Scalar y, Scalar z, int c, std::size_t* entry, Scalar* weight) {
  const Scalar position[3] = {x, y, z};
  std::uint32_t index[3];
  *weight = 1;
  for (int i = 0; i < 3; ++i) {
    const Scalar p = position[i] * static_cast<Scalar>(level.resolution);
    const Scalar cell = std::min(std::floor(p), static_cast<Scalar>(level.resolution - 1));
    const bool upper = c >> i & 1;
    *weight *= upper ? p - cell : 1 - (p - cell);
    index[i] = static_cast<std::uint32_t>(cell) + upper;
  }
  const std::uint32_t stride = level.resolution + 1;
  *entry = level.hash_mask ? (index[0] ^ (index[1] * 2654435761u) ^ (index[2] * 805459861u)) & level.hash_mask
                           : index[0] + stride * (index[1] + stride * index[2]);
}

template <typename Scalar>
void Encode(const GridLevel& level,
            const Scalar* table,
            const Scalar* x,
            const Scalar* y,
            const Scalar* z,
            int n,
            Scalar* features,
            int row_stride) {
  for (int i = 0; i < n; ++i) {
    for (int f = 0; f < kFeatures; ++f) {
      Scalar sum = 0;
      for (int c = 0; c < 8; ++c) {
        std::size_t entry;
        Scalar weight;
        Corner(level, x[i], y[i], z[i], c, &entry, &weight);
        sum += weight * table[entry * kFeatures + static_cast<std::size_t>(f)];
      }
      features[i * row_stride + f] = sum;
    }
  }
}

template <typename Scalar>
void Scatter(const GridLevel& level,
             const Scalar* feature_gradients,
             const Scalar* x,
             const Scalar* y,
             const Scalar* z,
             int n,
             Scalar* table_gradient) {
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < 8; ++c) {
      std::size_t entry;
      Scalar weight;
      Corner(level, x[i], y[i], z[i], c, &entry, &weight);
      for (std::size_t f = 0; f < kFeatures; ++f) {
        table_gradient[entry * kFeatures + f] +=
            weight * feature_gradients[static_cast<std::size_t>(i) * kFeatures + f];
      }
    }
  }
}

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
