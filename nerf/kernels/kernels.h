// The inner loops of the `hash` field, as plain functions on raw arrays, in three builds of one source
// (portable, AVX2, AVX-512) chosen at run time. Every function has a plain twin in kernels/reference.h that
// tests compare it with.
//
// Layout: matrices are row-major with one row per sample. Widths (k, m) are multiples of 16 unless stated;
// arrays need no particular alignment; the caller owns all memory; in- and outputs do not overlap unless
// stated.
//
// Error bounds against exact arithmetic (swept in tests/nerf_kernels_test.cpp):
//   exp: relative error <= 2.5e-7 for x in [-87, 88], e^-87 below (not denormal), e^88 above, NaN stays;
//   1 - e^-x: relative error <= 5e-7 for x in [0, inf);
//   sigmoid: relative error <= 6e-7;
//   matmul: |error| <= 2 k 2^-24 sum |x||w|.
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

enum class Epilogue {
  kNone,  // y = x w
  kRelu,  // y = max(x w, 0)
  kMask   // y = x w where mask > 0, else 0: the backward pass of ReLU
};

struct AdamStep {
  float learning_rate = 0, beta1 = 0.9f, beta2 = 0.99f;
  float epsilon = 1e-15f;                  // far below any useful gradient: sparse entries take full steps
  float correction1 = 1, correction2 = 1;  // 1 / (1 - beta^step)
};

struct Kernels {
  const char* name;

  // features[i * row_stride + 0..3] = trilinear value of `table` (entries x kFeatures, of this level) at
  // positions x[i], y[i], z[i] in [0, 1].
  void (*encode)(const GridLevel& level,
                 const float* table,
                 const float* x,
                 const float* y,
                 const float* z,
                 int n,
                 float* features,
                 int row_stride);

  // table_gradient += d loss / d table for feature gradients [n][kFeatures]; the transpose of `encode`. Rows
  // of zeros are skipped.
  void (*scatter)(const GridLevel& level,
                  const float* feature_gradients,
                  const float* x,
                  const float* y,
                  const float* z,
                  int n,
                  float* table_gradient);

  // y[n][m] = epilogue(x[n][k] w[k][m]); mask has y's shape and is read for kMask only.
  void (*matmul)(
      int n, int k, int m, const float* x, const float* w, Epilogue epilogue, const float* mask, float* y);

  // w_gradient[k][m] += x[n][k]^T y_gradient[n][m].
  void (*matmul_gradient)(int n, int k, int m, const float* x, const float* y_gradient, float* w_gradient);

  // The last layer, three outputs: logits[n][3] = x[n][k] w[3][k]^T.
  void (*head)(int n, int k, const float* x, const float* w, float* logits);
  // x_gradient[n][k] = logit_gradients[n][3] w[3][k] where x > 0, else 0; w_gradient += logit_gradients^T x.
  void (*head_gradient)(int n,
                        int k,
                        const float* x,
                        const float* w,
                        const float* logit_gradients,
                        float* x_gradient,
                        float* w_gradient);

  // In place over n values: e^x, 1 - e^-x, 1 / (1 + e^-x).
  void (*exp)(int n, float* values);
  void (*one_minus_exp_neg)(int n, float* values);
  void (*sigmoid)(int n, float* values);

  // Adam [Kingma & Ba 2015] on the elements whose gradient is not zero (others keep value and moments, so
  // that entries no ray has touched do not drift); gradients are cleared.
  void (*adam)(const AdamStep& step, std::size_t n, float* gradients, float* m, float* v, float* values);
};

// The fastest build this CPU runs; PIPELINE_SIMD=portable|avx2|avx512 lowers the choice (for tests and
// comparisons).
const Kernels& ActiveKernels();

// nullptr when this CPU, or this build of the program, lacks it. name: "portable", "avx2", "avx512".
const Kernels* FindKernels(const char* name);

}  // namespace nerf::kernels
