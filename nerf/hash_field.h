// The `hash` radiance field: a multi-resolution hash grid [Müller et al. 2022] feeding two small networks.
//
//   features = grid(position)                       n_levels x 4 values
//   out      = relu(features W1) W2                 16 values; sigma = exp(out[0] + kDensityBias), per scene
//   unit rgb      = sigmoid(relu(relu([out, SH(direction)] W3) W4) W5)
//
// No biases in the layers. All arrays are float32; one row per sample.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/kernels/kernels.h"
#include "nerf/radiance_field.h"
#include "nerf/spherical_harmonics.h"

namespace nerf {

struct HashFieldOptions {
  int n_levels = 8;            // 8 x 4 features = 32 inputs; the networks are built for this width
  int log2_hashmap_size = 18;  // entries of a hashed level
  int base_resolution = 16;    // cells per axis of the coarsest level
  int finest_resolution = 512;
};

// Rows of one chunk of samples, reused from chunk to chunk. The caller sets `harmonics` rows before
// QueryColour.
struct FieldRows {
  int n = 0;
  std::vector<float> features, hidden, sigma;          // [n][32], [n][64], [n]
  std::vector<float> out;                              // [n][16]
  std::vector<float> colour_in;                        // [n][32] = out, harmonics
  std::vector<float> colour1, colour2, rgb;            // [n][64], [n][64], [n][3]
  std::vector<float> gradient_a, gradient_b;           // [n][64] scratch of the backward pass
  std::vector<float> out_gradient, features_gradient;  // [n][16], [n][32]

  void Resize(int rows);
};

class HashField : public RadianceField {
 public:
  static constexpr int kInputs = 32, kHidden = 64, kOutputs = 16;
  // exp(0 - 1) = 0.37 per unit: a thin, everywhere equal fog to start from, so that gradients reach every
  // depth.
  static constexpr float kDensityBias = -1.f;
  // Forward limit of the exponent: e^15 per unit is opaque within any interval. Beyond it the density is
  // constant and its gradient zero [as instant-ngp].
  static constexpr float kMaxLogDensity = 15.f;

  HashField(const HashFieldOptions& options, std::uint64_t seed);

  // Fills features of all levels for samples [first, first + n) of `samples`, rows of kInputs.
  void Encode(const Samples& samples, int first, int n, float* features) const;
  // features [rows->n][32] -> hidden, out, sigma. `features` may be rows->features.
  void QueryDensity(const float* features, FieldRows* rows) const;
  // out and harmonics (in colour_in[16..31]) -> rgb.
  void QueryColour(FieldRows* rows) const;
  // Adds the gradients of all network weights for given d loss / d rgb-logits [n][3] and d loss / d log sigma
  // [n], and fills rows->features_gradient.
  void Backward(const float* logit_gradients,
                const float* log_sigma_gradients,
                FieldRows* rows,
                float* weight_gradients) const;

  // Adds table gradients of one level.
  void Scatter(int level, const float* feature_gradients, const Samples& samples, int n);
  void StepTable(int level, const kernels::AdamStep& step);
  // Consumes (and clears) weight_gradients.
  void StepWeights(const kernels::AdamStep& step, float* weight_gradients);

  std::string kind() const override { return "hash"; }
  FieldConfig Config() const override;
  std::vector<Tensor> State() override;
  void Refresh() override;
  std::size_t n_parameters() const override { return table_.size() + weights_.size(); }
  void QueryDensity(const Samples& samples, float* sigma) const override;
  void Query(const Samples& samples,
             std::span<const Ray> rays,
             std::span<const int> ray_of,
             int pass,
             float* sigma,
             float* rgb) const override;

  const HashFieldOptions& options() const { return options_; }
  const std::vector<kernels::GridLevel>& levels() const { return levels_; }
  std::size_t n_weights() const { return weights_.size(); }

 private:
  HashFieldOptions options_;
  const kernels::Kernels& kernels_;
  std::vector<kernels::GridLevel> levels_;
  std::vector<float> table_, table_gradient_, table_m_, table_v_;
  std::vector<float> weights_, weights_m_, weights_v_;
  std::vector<float> transposed_;  // of W1, W2, W3's first rows and W4, for the backward pass
};

}  // namespace nerf
