#include "nerf/fields/hash_network.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "io/base/hash.h"
#include "io/base/random.h"
#include "nerf/fields/spherical_harmonics.h"

namespace nerf {
namespace {

using kernels::Bf16;
using kernels::Epilogue;

constexpr std::size_t kIn = HashNetwork<float>::kInputs, kHid = HashNetwork<float>::kHidden,
                      kOut = HashNetwork<float>::kOutputs;
// Offsets in the transposed copies: W1^T [64][32], W2^T [16][64], (W3's first 16 rows)^T [64][16], W4^T
// [64][64].
constexpr std::size_t kT1 = 0, kT2 = kT1 + kHid * kIn, kT3 = kT2 + kOut * kHid, kT4 = kT3 + kHid * kOut,
                      kTransposed = kT4 + kHid * kHid;

// Rows whose densities are queried together: their activations stay in the first-level caches.
constexpr int kQueryRows = 128;

}  // namespace

template <typename Real>
void NetworkRows<Real>::Resize(int rows) {
  n = rows;
  const auto count = static_cast<std::size_t>(rows);
  const auto grow = [&](auto* v, std::size_t width) {
    if (v->size() < count * width) v->resize(count * width);
  };
  grow(&features, kIn), grow(&hidden, kHid), grow(&sigma, 1), grow(&out, kOut), grow(&colour_in, kIn);
  grow(&colour1, kHid), grow(&colour2, kHid), grow(&rgb, 3), grow(&gradient_a, kHid), grow(&gradient_b, kHid);
  grow(&out_gradient, kOut), grow(&rounded_out_gradient, kOut), grow(&features_gradient, kIn);
}

template <typename Real>
HashNetwork<Real>::HashNetwork(std::uint64_t seed)
    : kernels_(kernels::ActiveKernels()),
      layers_(kernels_.Network<Real>()),
      weights_(kEnd),
      weights_m_(kEnd, 0.f),
      weights_v_(kEnd, 0.f),
      packed_(kW5),
      transposed_(kTransposed) {
  const auto init = [&](std::size_t first, std::size_t count, std::size_t fan_in, std::size_t fan_out) {
    const float limit =
        std::sqrt(6.f / static_cast<float>(fan_in + fan_out));  // Xavier [Glorot & Bengio 2010]
    for (std::size_t i = first; i < first + count; ++i) {
      weights_[i] = limit * (2.f * io::Random(seed, io::Stream::kInit, 1, i).Uniform() - 1.f);
    }
  };
  init(kW1, kIn * kHid, kIn, kHid);
  init(kW2, kHid * kOut, kHid, kOut);
  init(kW3, kIn * kHid, kIn, kHid);
  init(kW4, kHid * kHid, kHid, kHid);
  init(kW5, 3 * kHid, kHid, 3);
  Refresh();
}

template <typename Real>
std::string HashNetwork<Real>::Hash() const {
  return io::HashBytes({reinterpret_cast<const char*>(weights_.data()), weights_.size() * sizeof(float)});
}

template <typename Real>
void HashNetwork<Real>::Refresh() {
  std::vector<float> transpose(kHid * kHid);
  const auto pack = [&](std::size_t at, int k, int m, std::size_t transposed_at, int rows) {
    const float* w = &weights_[at];
    layers_.pack(k, m, w, &packed_[at]);
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < m; ++c) transpose[static_cast<std::size_t>(c * rows + r)] = w[r * m + c];
    }
    layers_.pack(m, rows, transpose.data(), &transposed_[transposed_at]);
  };
  pack(kW1, kInputs, kHidden, kT1, kInputs);
  pack(kW2, kHidden, kOutputs, kT2, kHidden);
  pack(kW3, kInputs, kHidden, kT3, kOutputs);  // the directions' gradient is not needed
  pack(kW4, kHidden, kHidden, kT4, kHidden);
}

template <typename Real>
void HashNetwork<Real>::QueryDensity(NetworkRows<Real>* rows) const {
  const int n = rows->n;
  layers_.matmul(n,
                 kInputs,
                 kHidden,
                 rows->features.data(),
                 &packed_[kW1],
                 Epilogue::kRelu,
                 nullptr,
                 rows->hidden.data());
  layers_.matmul_sums(n, kHidden, kOutputs, rows->hidden.data(), &packed_[kW2], rows->out.data());
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    const float log_sigma = rows->out[i * kOut] + kDensityBias;
    rows->sigma[i] = log_sigma > kMaxLogDensity ? kMaxLogDensity : log_sigma;  // a NaN stays
  }
  kernels_.exp(n, rows->sigma.data());
}

template <typename Real>
void HashNetwork<Real>::QueryDensity(int n,
                                     const Real* features,
                                     NetworkRows<Real>* scratch,
                                     float* sigma) const {
  for (int first = 0; first < n; first += kQueryRows) {
    scratch->Resize(std::min(kQueryRows, n - first));
    std::copy_n(features + static_cast<std::ptrdiff_t>(first) * kInputs,
                scratch->n * kInputs,
                scratch->features.data());
    QueryDensity(scratch);
    std::copy_n(scratch->sigma.data(), scratch->n, sigma + first);
  }
}

template <typename Real>
void HashNetwork<Real>::SetDirection(const float direction[3],
                                     int first,
                                     int last,
                                     NetworkRows<Real>* rows) const {
  static_assert(kOutputs + kHarmonics == kInputs);
  float harmonics[kHarmonics];
  SphericalHarmonics(direction, harmonics);
  Real rounded[kHarmonics];
  layers_.round(1, kHarmonics, harmonics, rounded, kHarmonics);
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i)
    std::memcpy(&rows->colour_in[i * kIn + kOut], rounded, sizeof rounded);
}

template <typename Real>
void HashNetwork<Real>::QueryColour(NetworkRows<Real>* rows) const {
  const int n = rows->n;
  Real *in = rows->colour_in.data(), *first = rows->colour1.data(), *second = rows->colour2.data();
  layers_.round(n, kOutputs, rows->out.data(), in, kInputs);
  layers_.matmul(n, kInputs, kHidden, in, &packed_[kW3], Epilogue::kRelu, nullptr, first);
  layers_.matmul(n, kHidden, kHidden, first, &packed_[kW4], Epilogue::kRelu, nullptr, second);
  layers_.head(n, kHidden, second, &weights_[kW5], rows->rgb.data());
  kernels_.sigmoid(3 * n, rows->rgb.data());
}

template <typename Real>
void HashNetwork<Real>::Backward(const float* logit_gradients,
                                 const float* log_sigma_gradients,
                                 NetworkRows<Real>* rows,
                                 float* weight_gradients) const {
  const int n = rows->n;
  float* g = weight_gradients;
  Real *a = rows->gradient_a.data(), *b = rows->gradient_b.data();
  const Real *colour1 = rows->colour1.data(), *hidden = rows->hidden.data();
  layers_.head_gradient(n, kHidden, rows->colour2.data(), &weights_[kW5], logit_gradients, a, g + kW5);
  layers_.matmul_gradient(n, kHidden, kHidden, colour1, a, g + kW4);
  layers_.matmul(n, kHidden, kHidden, a, &transposed_[kT4], Epilogue::kMask, colour1, b);
  layers_.matmul_gradient(n, kInputs, kHidden, rows->colour_in.data(), b, g + kW3);
  float* out_gradient = rows->out_gradient.data();
  layers_.matmul_sums(n, kHidden, kOutputs, b, &transposed_[kT3], out_gradient);
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    const bool clamped = rows->out[i * kOut] + kDensityBias > kMaxLogDensity;
    out_gradient[i * kOut] += clamped ? 0.f : log_sigma_gradients[i];
  }
  Real* rounded = rows->rounded_out_gradient.data();
  layers_.round(n, kOutputs, out_gradient, rounded, kOutputs);
  layers_.matmul_gradient(n, kHidden, kOutputs, hidden, rounded, g + kW2);
  layers_.matmul(n, kOutputs, kHidden, rounded, &transposed_[kT2], Epilogue::kMask, hidden, a);
  layers_.matmul_gradient(n, kInputs, kHidden, rows->features.data(), a, g + kW1);
  layers_.matmul(
      n, kHidden, kInputs, a, &transposed_[kT1], Epilogue::kNone, nullptr, rows->features_gradient.data());
}

template <typename Real>
void HashNetwork<Real>::Step(const kernels::AdamStep& step, float* weight_gradients) {
  kernels_.adam(step, kEnd, weight_gradients, weights_m_.data(), weights_v_.data(), weights_.data(), nullptr);
  Refresh();
}

template <typename Real>
std::vector<Tensor> HashNetwork<Real>::State() {
  return {{"weights", weights_}, {"weights_m", weights_m_}, {"weights_v", weights_v_}};
}

template struct NetworkRows<float>;
template struct NetworkRows<Bf16>;
template class HashNetwork<float>;
template class HashNetwork<Bf16>;

}  // namespace nerf
