// The two small networks of the `hash` field.
//
//   out      = relu(features W1) W2                 16 values; sigma = exp(out[0] + kDensityBias), per scene
//   unit rgb = sigmoid(relu(relu([out, SH(direction)] W3) W4) W5)
//
// No biases in the layers. Activations and their gradients are rows of Real, float or Bf16, one row per
// sample; weights, sums, densities and colours are float. With Bf16 a product's factors are rounded to 8
// bits.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nerf/fields/radiance_field.h"
#include "nerf/kernels/aligned_vector.h"
#include "nerf/kernels/kernels.h"

namespace nerf {

// Rows of one chunk of samples, reused from chunk to chunk.
template <typename Real>
struct NetworkRows {
  int n = 0;
  AlignedVector<Real> features, hidden;        // [n][32], [n][64]
  AlignedVector<float> out, sigma;             // [n][16], [n]
  AlignedVector<Real> colour_in;               // [n][32] = out, harmonics
  AlignedVector<Real> colour1, colour2;        // [n][64]
  AlignedVector<float> rgb;                    // [n][3]
  AlignedVector<Real> gradient_a, gradient_b;  // [n][64] scratch of the backward pass
  AlignedVector<float> out_gradient;           // [n][16]
  AlignedVector<Real> rounded_out_gradient;    // [n][16]
  AlignedVector<Real> features_gradient;       // [n][32]

  void Resize(int rows);
};

template <typename Real>
class HashNetwork {
 public:
  static constexpr int kInputs = 32, kHidden = 64, kOutputs = 16;
  // Where the layers begin in the tensor "weights", and its end. W1 to W4 are [inputs][outputs], W5 is
  // [3][kHidden].
  static constexpr std::size_t kW1 = 0, kW2 = kW1 + kInputs * kHidden, kW3 = kW2 + kHidden * kOutputs,
                               kW4 = kW3 + kInputs * kHidden, kW5 = kW4 + kHidden * kHidden,
                               kEnd = kW5 + 3 * kHidden;
  // exp(0 - 1) = 0.37 per unit: a thin, everywhere equal fog to start from, so that gradients reach every
  // depth.
  static constexpr float kDensityBias = -1.f;
  // Forward limit of the exponent: e^15 per unit is opaque within any interval. Beyond it the density is
  // constant and its gradient zero [as instant-ngp].
  static constexpr float kMaxLogDensity = 15.f;

  explicit HashNetwork(std::uint64_t seed);

  // rows->features -> hidden, out, sigma.
  void QueryDensity(NetworkRows<Real>* rows) const;
  // Densities sigma [n] alone, of features [n][32], by chunks.
  void QueryDensity(int n, const Real* features, NetworkRows<Real>* scratch, float* sigma) const;
  // Sets the direction that samples [first, last) are seen along.
  void SetDirection(const float direction[3], int first, int last, NetworkRows<Real>* rows) const;
  // out and directions -> rgb.
  void QueryColour(NetworkRows<Real>* rows) const;
  // Adds the gradients of all weights for given d loss / d rgb-logits [n][3] and d loss / d log sigma [n],
  // and fills rows->features_gradient.
  void Backward(const float* logit_gradients,
                const float* log_sigma_gradients,
                NetworkRows<Real>* rows,
                float* weight_gradients) const;
  // Consumes and clears weight_gradients.
  void Step(const kernels::AdamStep& step, float* weight_gradients);

  // To be called after weights were set through State().
  void Refresh();
  std::vector<Tensor> State();
  std::size_t n_weights() const { return weights_.size(); }
  std::string Hash() const;  // of the weights

 private:
  const kernels::Kernels& kernels_;
  const kernels::NetworkKernels<Real>& layers_;
  std::vector<float> weights_, weights_m_, weights_v_;
  // W1 to W4, and the transposes that the backward pass needs: of W1, W2, W3's first rows and W4.
  AlignedVector<Real> packed_, transposed_;
};

}  // namespace nerf
