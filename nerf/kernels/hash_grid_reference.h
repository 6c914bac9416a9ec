// The plain reference of the hash grid's kernels, part of reference.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "nerf/kernels/hash_grid_kernels.h"

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
void PositionGradient(const GridLevel& level,
                      const Scalar* table,
                      const Scalar* feature_gradients,
                      const Scalar* x,
                      const Scalar* y,
                      const Scalar* z,
                      int n,
                      Scalar* const position_gradient[3]) {
  for (int i = 0; i < n; ++i) {
    const Scalar position[3] = {x[i], y[i], z[i]};
    for (int c = 0; c < 8; ++c) {
      std::size_t entry;
      Scalar weight, product = 0;
      Corner(level, x[i], y[i], z[i], c, &entry, &weight);
      for (int f = 0; f < kFeatures; ++f)
        product +=
            feature_gradients[i * kFeatures + f] * table[entry * kFeatures + static_cast<std::size_t>(f)];
      for (int axis = 0; axis < 3; ++axis) {
        // d weight / d position: along its own axis a corner's factor has the slope +-resolution.
        Scalar slope =
            c >> axis & 1 ? static_cast<Scalar>(level.resolution) : -static_cast<Scalar>(level.resolution);
        for (int other = 0; other < 3; ++other) {
          if (other == axis) continue;
          const Scalar p = position[other] * static_cast<Scalar>(level.resolution);
          const Scalar fraction = p - std::min(std::floor(p), static_cast<Scalar>(level.resolution - 1));
          slope *= c >> other & 1 ? fraction : 1 - fraction;
        }
        position_gradient[axis][i] += slope * product;
      }
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

}  // namespace nerf::kernels::reference
