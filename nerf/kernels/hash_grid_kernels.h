// A level of the hash grid, and the kernels that read its table (kernels.h says how they are built and
// tested).
#pragma once

#include <cstddef>
#include <cstdint>

namespace nerf::kernels {

// Features per entry of the hash grid: one 16-byte load per corner.
inline constexpr int kFeatures = 4;

// One resolution level of the grid. Position x in [0, 1]^3 lies in cell floor(x * resolution); values are
// trilinear. Dense levels index corners as x + stride * (y + stride * z) with stride = resolution + 1. Hashed
// levels use (x ^ 2654435761 y ^ 805459861 z) mod 2^n [Teschner et al. 2003, Müller et al. 2022].
struct GridLevel {
  std::uint32_t resolution = 0;
  std::uint32_t hash_mask = 0;  // entries - 1; 0: dense
  std::size_t first_entry = 0;  // into the tables of the whole grid
  std::size_t n_entries = 0;
};

// features[i * row_stride + 0..3] = trilinear value of `table` (entries x kFeatures, of this level) at
// positions x[i], y[i], z[i] in [0, 1]. Weights and sums are float.
template <typename Table, typename Real>
using EncodeFunction = void (*)(const GridLevel& level,
                                const Table* table,
                                const float* x,
                                const float* y,
                                const float* z,
                                int n,
                                Real* features,
                                int row_stride);

// position_gradient[axis][i] += d loss / d position for feature gradients [n][kFeatures]: the derivative of
// `encode`, whose trilinear values have a slope of their own in every cell.
template <typename Table, typename Real>
using PositionGradientFunction = void (*)(const GridLevel& level,
                                          const Table* table,
                                          const Real* feature_gradients,
                                          const float* x,
                                          const float* y,
                                          const float* z,
                                          int n,
                                          float* const position_gradient[3]);

}  // namespace nerf::kernels
