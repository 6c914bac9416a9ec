// The inner loops of the `hash` field and of splats, as plain functions on raw arrays, in four builds of one
// source (portable, AVX2, AVX-512, AVX-512 with bfloat16) chosen at run time. Every function has a plain
// reference in a *reference.h beside this file that tests compare it with.
//
// Layout: matrices are row-major with one row per sample. Widths (k, m) are multiples of 16 unless stated;
// arrays need no particular alignment; the caller owns all memory; in- and outputs do not overlap.
//
// Error bounds against exact arithmetic (swept in tests/nerf/kernels/kernels_test.cpp):
//   exp: relative error <= 2.5e-7 for x in [-87, 88], e^-87 below (not denormal), e^88 above, NaN stays;
//   1 - e^-x: relative error <= 5e-7 for x in [0, inf);
//   sigmoid: relative error <= 6e-7;
//   products: |error| <= 2 k 2^-24 sum |x||w| for the values that are multiplied; rounding to Bf16 adds
//   2^-9 of each value before and of the result after.
#pragma once

#include <cstddef>
#include <cstdint>

#include "nerf/kernels/hash_grid_kernels.h"
#include "nerf/kernels/march.h"
#include "nerf/kernels/splat_blending.h"
#include "nerf/kernels/splat_projection.h"

namespace nerf::kernels {

// The upper half of a float: its range, 8 bits of precision. Rounded to nearest even.
enum class Bf16 : std::uint16_t {};

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

// What the networks and the grid compute, with activations as Real: float, or Bf16 with sums in float.
template <typename Real>
struct NetworkKernels {
  EncodeFunction<float, Real> encode;
  EncodeFunction<Bf16, Real> encode_bf16;

  // table_gradient += d loss / d table for feature gradients [n][kFeatures]; the transpose of `encode`.
  void (*scatter)(const GridLevel& level,
                  const Real* feature_gradients,
                  const float* x,
                  const float* y,
                  const float* z,
                  int n,
                  float* table_gradient);

  PositionGradientFunction<float, Real> position_gradient;
  PositionGradientFunction<Bf16, Real> position_gradient_bf16;
  // Weights w[k][m] in the order of the products: float as they are; Bf16 rounded, [k / 2][m][2].
  void (*pack)(int k, int m, const float* w, Real* packed);
  // y[n][m] = epilogue(x[n][k] w[k][m]); mask has y's shape and is read for kMask only.
  void (*matmul)(
      int n, int k, int m, const Real* x, const Real* packed, Epilogue epilogue, const Real* mask, Real* y);
  // y[n][m] = x[n][k] w[k][m], unrounded.
  void (*matmul_sums)(int n, int k, int m, const Real* x, const Real* packed, float* y);
  // w_gradient[k][m] += x[n][k]^T y_gradient[n][m]; k, m <= 64.
  void (*matmul_gradient)(int n, int k, int m, const Real* x, const Real* y_gradient, float* w_gradient);

  // The last layer, three outputs: logits[n][3] = x[n][k] w[3][k]^T.
  void (*head)(int n, int k, const Real* x, const float* w, float* logits);
  // x_gradient[n][k] = logit_gradients[n][3] w[3][k] where x > 0, else 0; w_gradient += logit_gradients^T x.
  void (*head_gradient)(int n,
                        int k,
                        const Real* x,
                        const float* w,
                        const float* logit_gradients,
                        Real* x_gradient,
                        float* w_gradient);

  // rows[i * row_stride + j] = values[n][width], rounded.
  void (*round)(int n, int width, const float* values, Real* rows, int row_stride);
  // Whether none of n values, a multiple of 16, is infinite or NaN.
  bool (*all_finite)(int n, const Real* values);
};

struct Kernels {
  const char* name;
  NetworkKernels<float> fp32;
  NetworkKernels<Bf16> bf16;

  // In place over n values: e^x, 1 - e^-x, 1 / (1 + e^-x).
  void (*exp)(int n, float* values);
  void (*one_minus_exp_neg)(int n, float* values);
  void (*sigmoid)(int n, float* values);

  // Adam [Kingma & Ba 2015] on the elements whose gradient is not zero: others, which no ray has touched,
  // keep every bit. Clears the gradients. `rounded`, unless null, is a copy of the values kept in step.
  void (*adam)(const AdamStep& step,
               std::size_t n,
               float* gradients,
               float* m,
               float* v,
               float* values,
               Bf16* rounded);
  // The same for entries [n][kFeatures] of a table, without momentum and with one second moment v[n] per
  // entry, of the mean square of its features' gradients. No step is longer than learning_rate sqrt(kFeatures
  // / (1 - beta2)), which an entry's first one reaches late in a run.
  void (*step_entries)(
      const AdamStep& step, std::size_t n, float* gradients, float* v, float* values, Bf16* rounded);

  MarchFunction march;

  ProjectSplatsFunction project_splats;
  ProjectSplatsGradientFunction project_splats_gradient;
  BlendSplatsFunction blend_splats;
  BlendSplatsGradientFunction blend_splats_gradient;

  template <typename Real>
  const NetworkKernels<Real>& Network() const {
    if constexpr (sizeof(Real) == sizeof(float))
      return fp32;
    else
      return bf16;
  }
};

// The fastest build this CPU runs; PIPELINE_SIMD=portable|avx2|avx512|avx512bf16 lowers the choice.
const Kernels& ActiveKernels();

// nullptr when this CPU, or this build of the program, lacks it.
const Kernels* FindKernels(const char* name);

// Whether the active build multiplies bfloat16 in hardware; else it widens them, which costs time.
bool HasBf16Products();

}  // namespace nerf::kernels
