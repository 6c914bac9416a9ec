#include "nerf/hash_field.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "io/check.h"
#include "nerf/random.h"

namespace nerf {
namespace {

using kernels::Epilogue;

constexpr std::size_t kIn = HashField::kInputs, kHid = HashField::kHidden, kOut = HashField::kOutputs;
// Offsets of the layers in the weight vector.
constexpr std::size_t kW1 = 0, kW2 = kW1 + kIn * kHid, kW3 = kW2 + kHid * kOut, kW4 = kW3 + kIn * kHid,
                      kW5 = kW4 + kHid * kHid, kWeights = kW5 + 3 * kHid;
// Offsets in the transposed copies: W1^T [64][32], W2^T [16][64], (W3's first 16 rows)^T [64][16], W4^T
// [64][64].
constexpr std::size_t kT1 = 0, kT2 = kT1 + kHid * kIn, kT3 = kT2 + kOut * kHid, kT4 = kT3 + kHid * kOut,
                      kTransposed = kT4 + kHid * kHid;

// Table entries start as tiny noise, so that the coarse levels dominate the first steps [instant-ngp].
constexpr float kTableInit = 1e-4f;
// Rows that are queried together: their activations stay in a 1 MB second-level cache.
constexpr int kQueryRows = 512;

void Transpose(const float* in, std::size_t rows, std::size_t columns, float* out) {
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) out[c * rows + r] = in[r * columns + c];
  }
}

}  // namespace

void FieldRows::Resize(int rows) {
  n = rows;
  const auto count = static_cast<std::size_t>(rows);
  const auto grow = [&](std::vector<float>* v, std::size_t width) {
    if (v->size() < count * width) v->resize(count * width);
  };
  grow(&features, kIn), grow(&hidden, kHid), grow(&sigma, 1), grow(&out, kOut), grow(&colour_in, kIn);
  grow(&colour1, kHid), grow(&colour2, kHid), grow(&rgb, 3), grow(&gradient_a, kHid), grow(&gradient_b, kHid);
  grow(&out_gradient, kOut), grow(&features_gradient, kIn);
}

HashField::HashField(const HashFieldOptions& options, std::uint64_t seed)
    : options_(options), kernels_(kernels::ActiveKernels()) {
  PIPELINE_CHECK_EQ(options.n_levels * kernels::kFeatures, kInputs);
  const double growth = std::pow(static_cast<double>(options.finest_resolution) / options.base_resolution,
                                 1.0 / (options.n_levels - 1));
  std::size_t n_entries = 0;
  for (int l = 0; l < options.n_levels; ++l) {
    kernels::GridLevel level;
    level.resolution = static_cast<std::uint32_t>(std::lround(options.base_resolution * std::pow(growth, l)));
    const std::size_t hashed = std::size_t{1} << options.log2_hashmap_size, side = level.resolution + 1;
    const bool dense = side * side * side <= hashed;
    level.n_entries = dense ? side * side * side : hashed;
    level.hash_mask = dense ? 0 : static_cast<std::uint32_t>(hashed - 1);
    level.first_entry = n_entries;
    n_entries += level.n_entries;
    levels_.push_back(level);
  }
  table_.resize(n_entries * kernels::kFeatures);
  for (std::size_t i = 0; i < table_.size(); ++i) {
    table_[i] = kTableInit * (2.f * Random(seed, Stream::kInit, 0, i).Uniform() - 1.f);
  }
  table_gradient_.assign(table_.size(), 0.f);
  table_m_.assign(table_.size(), 0.f);
  table_v_.assign(table_.size(), 0.f);

  weights_.resize(kWeights);
  const auto init = [&](std::size_t first, std::size_t count, std::size_t fan_in, std::size_t fan_out) {
    const float limit =
        std::sqrt(6.f / static_cast<float>(fan_in + fan_out));  // Xavier [Glorot & Bengio 2010]
    for (std::size_t i = first; i < first + count; ++i) {
      weights_[i] = limit * (2.f * Random(seed, Stream::kInit, 1, i).Uniform() - 1.f);
    }
  };
  init(kW1, kIn * kHid, kIn, kHid);
  init(kW2, kHid * kOut, kHid, kOut);
  init(kW3, kIn * kHid, kIn, kHid);
  init(kW4, kHid * kHid, kHid, kHid);
  init(kW5, 3 * kHid, kHid, 3);
  weights_m_.assign(kWeights, 0.f);
  weights_v_.assign(kWeights, 0.f);
  transposed_.resize(kTransposed);
  Refresh();
}

void HashField::Refresh() {
  const float* w = weights_.data();
  Transpose(w + kW1, kIn, kHid, &transposed_[kT1]);
  Transpose(w + kW2, kHid, kOut, &transposed_[kT2]);
  Transpose(w + kW3, kOut, kHid, &transposed_[kT3]);
  Transpose(w + kW4, kHid, kHid, &transposed_[kT4]);
}

void HashField::Encode(const Samples& samples, int first, int n, float* features) const {
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    kernels_.encode(levels_[l],
                    &table_[levels_[l].first_entry * kernels::kFeatures],
                    samples.x.data() + first,
                    samples.y.data() + first,
                    samples.z.data() + first,
                    n,
                    features + l * kernels::kFeatures,
                    kInputs);
  }
}

void HashField::QueryDensity(const float* features, FieldRows* rows) const {
  const float* w = weights_.data();
  kernels_.matmul(
      rows->n, kInputs, kHidden, features, w + kW1, Epilogue::kRelu, nullptr, rows->hidden.data());
  kernels_.matmul(
      rows->n, kHidden, kOutputs, rows->hidden.data(), w + kW2, Epilogue::kNone, nullptr, rows->out.data());
  for (std::size_t i = 0; i < static_cast<std::size_t>(rows->n); ++i) {
    const float log_sigma = rows->out[i * kOut] + kDensityBias;
    rows->sigma[i] = log_sigma > kMaxLogDensity ? kMaxLogDensity : log_sigma;  // a NaN stays
  }
  kernels_.exp(rows->n, rows->sigma.data());
}

void HashField::QueryColour(FieldRows* rows) const {
  const float* w = weights_.data();
  for (std::size_t i = 0; i < static_cast<std::size_t>(rows->n); ++i) {
    std::memcpy(&rows->colour_in[i * kIn], &rows->out[i * kOut], kOut * sizeof(float));
  }
  kernels_.matmul(rows->n,
                  kInputs,
                  kHidden,
                  rows->colour_in.data(),
                  w + kW3,
                  Epilogue::kRelu,
                  nullptr,
                  rows->colour1.data());
  kernels_.matmul(rows->n,
                  kHidden,
                  kHidden,
                  rows->colour1.data(),
                  w + kW4,
                  Epilogue::kRelu,
                  nullptr,
                  rows->colour2.data());
  kernels_.head(rows->n, kHidden, rows->colour2.data(), w + kW5, rows->rgb.data());
  kernels_.sigmoid(3 * rows->n, rows->rgb.data());
}

void HashField::Backward(const float* logit_gradients,
                         const float* log_sigma_gradients,
                         FieldRows* rows,
                         float* weight_gradients) const {
  const int n = rows->n;
  const float* w = weights_.data();
  float* g = weight_gradients;
  float* a = rows->gradient_a.data();
  float* b = rows->gradient_b.data();
  kernels_.head_gradient(n, kHidden, rows->colour2.data(), w + kW5, logit_gradients, a, g + kW5);
  kernels_.matmul_gradient(n, kHidden, kHidden, rows->colour1.data(), a, g + kW4);
  kernels_.matmul(n, kHidden, kHidden, a, &transposed_[kT4], Epilogue::kMask, rows->colour1.data(), b);
  kernels_.matmul_gradient(n, kInputs, kHidden, rows->colour_in.data(), b, g + kW3);
  float* out_gradient = rows->out_gradient.data();
  kernels_.matmul(n, kHidden, kOutputs, b, &transposed_[kT3], Epilogue::kNone, nullptr, out_gradient);
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    const bool clamped = rows->out[i * kOut] + kDensityBias > kMaxLogDensity;
    out_gradient[i * kOut] += clamped ? 0.f : log_sigma_gradients[i];
  }
  kernels_.matmul_gradient(n, kHidden, kOutputs, rows->hidden.data(), out_gradient, g + kW2);
  kernels_.matmul(
      n, kOutputs, kHidden, out_gradient, &transposed_[kT2], Epilogue::kMask, rows->hidden.data(), a);
  kernels_.matmul_gradient(n, kInputs, kHidden, rows->features.data(), a, g + kW1);
  kernels_.matmul(
      n, kHidden, kInputs, a, &transposed_[kT1], Epilogue::kNone, nullptr, rows->features_gradient.data());
}

void HashField::Scatter(int level, const float* feature_gradients, const Samples& samples, int n) {
  const kernels::GridLevel& l = levels_[static_cast<std::size_t>(level)];
  kernels_.scatter(l,
                   feature_gradients,
                   samples.x.data(),
                   samples.y.data(),
                   samples.z.data(),
                   n,
                   &table_gradient_[l.first_entry * kernels::kFeatures]);
}

void HashField::StepTable(int level, const kernels::AdamStep& step) {
  const kernels::GridLevel& l = levels_[static_cast<std::size_t>(level)];
  const std::size_t first = l.first_entry * kernels::kFeatures;
  kernels_.adam(step,
                l.n_entries * kernels::kFeatures,
                &table_gradient_[first],
                &table_m_[first],
                &table_v_[first],
                &table_[first]);
}

void HashField::StepWeights(const kernels::AdamStep& step, float* weight_gradients) {
  kernels_.adam(step, kWeights, weight_gradients, weights_m_.data(), weights_v_.data(), weights_.data());
  Refresh();
}

void HashField::QueryDensity(const Samples& samples, float* sigma) const {
  thread_local FieldRows rows;
  for (int first = 0; first < samples.size(); first += kQueryRows) {
    rows.Resize(std::min(kQueryRows, samples.size() - first));
    Encode(samples, first, rows.n, rows.features.data());
    QueryDensity(rows.features.data(), &rows);
    std::copy_n(rows.sigma.begin(), rows.n, sigma + first);
  }
}

void HashField::Query(const Samples& samples,
                      std::span<const Ray> rays,
                      std::span<const int> ray_of,
                      int /*pass*/,
                      float* sigma,
                      float* rgb) const {
  thread_local FieldRows rows;
  thread_local std::vector<float> harmonics;
  harmonics.resize(rays.size() * kHarmonics);
  for (std::size_t r = 0; r < rays.size(); ++r)
    SphericalHarmonics(rays[r].direction, &harmonics[r * kHarmonics]);
  for (int first = 0; first < samples.size(); first += kQueryRows) {
    rows.Resize(std::min(kQueryRows, samples.size() - first));
    Encode(samples, first, rows.n, rows.features.data());
    QueryDensity(rows.features.data(), &rows);
    for (std::size_t i = 0; i < static_cast<std::size_t>(rows.n); ++i) {
      const auto ray = static_cast<std::size_t>(ray_of[static_cast<std::size_t>(first) + i]);
      std::memcpy(&rows.colour_in[i * kIn + kOut], &harmonics[ray * kHarmonics], kHarmonics * sizeof(float));
    }
    QueryColour(&rows);
    std::copy_n(rows.sigma.begin(), rows.n, sigma + first);
    std::copy_n(rows.rgb.begin(), 3 * rows.n, rgb + 3 * first);
  }
}

FieldConfig HashField::Config() const {
  return {{"n_levels", options_.n_levels},
          {"log2_hashmap_size", options_.log2_hashmap_size},
          {"base_resolution", options_.base_resolution},
          {"finest_resolution", options_.finest_resolution}};
}

std::vector<Tensor> HashField::State() {
  return {{"table", &table_},
          {"table_m", &table_m_},
          {"table_v", &table_v_},
          {"weights", &weights_},
          {"weights_m", &weights_m_},
          {"weights_v", &weights_v_}};
}

}  // namespace nerf
