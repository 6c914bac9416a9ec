// The hand-written backward pass of the whole field against central differences of its double-precision
// reference, with networks in float and in bfloat16.
#include "nerf/fields/hash_field.h"

#include <gtest/gtest.h>

#include <cmath>

#include "io/base/random.h"
#include "nerf/fields/spherical_harmonics.h"
#include "nerf/kernels/reference.h"
#include "tests/support/scenes/field_tensor.h"

namespace nerf {
namespace {

namespace ref = kernels::reference;
using kernels::Epilogue;
using tests::TensorOf;
using Doubles = std::vector<double>;
using Net = HashNetwork<float>;

constexpr int kSamples = 7;
HashFieldOptions Small(bool bf16_network) {
  return {.grid = {.n_levels = 8, .log2_hashmap_size = 8, .base_resolution = 3, .finest_resolution = 40},
          .bf16_network = bf16_network};
}

struct Reference {  // the field's parameters in double, and its equations in order
  std::vector<kernels::GridLevel> levels;
  Doubles table, weights;

  // Sum over samples of a . rgb-logits + b log sigma, a linear probe of both outputs.
  double Probe(const Samples& samples,
               const float directions[][3],
               const Doubles& a,
               const Doubles& b) const {
    double sum = 0;
    for (std::size_t s = 0; s < static_cast<std::size_t>(samples.size()); ++s) {
      Doubles features(32), hidden(64), out(16), in(32), c1(64), c2(64), logits(3);
      const double x = samples.x[s], y = samples.y[s], z = samples.z[s];
      for (std::size_t l = 0; l < levels.size(); ++l) {
        ref::Encode(levels[l], &table[levels[l].first_entry * 4], &x, &y, &z, 1, &features[4 * l], 32);
      }
      const double* w = weights.data();
      ref::Matmul<double>(1, 32, 64, features.data(), w + Net::kW1, Epilogue::kRelu, nullptr, hidden.data());
      ref::Matmul<double>(1, 64, 16, hidden.data(), w + Net::kW2, Epilogue::kNone, nullptr, out.data());
      std::copy(out.begin(), out.end(), in.begin());
      const double d[3] = {directions[s][0], directions[s][1], directions[s][2]};
      SphericalHarmonics(d, &in[16]);
      ref::Matmul<double>(1, 32, 64, in.data(), w + Net::kW3, Epilogue::kRelu, nullptr, c1.data());
      ref::Matmul<double>(1, 64, 64, c1.data(), w + Net::kW4, Epilogue::kRelu, nullptr, c2.data());
      ref::Head(1, 64, c2.data(), w + Net::kW5, logits.data());
      for (std::size_t c = 0; c < 3; ++c) sum += a[3 * s + c] * logits[c];
      sum += b[s] * (out[0] + Net::kDensityBias);
    }
    return sum;
  }
};

template <typename Real>
class HashFieldTest : public testing::Test {
 protected:
  // A product of two bfloat16 values is off by up to 2^-8 of it; errors of both signs mostly cancel, but a
  // ReLU near zero that falls on the other side changes a gradient as a whole.
  static constexpr bool kBf16 = sizeof(Real) == 2;
  static constexpr double kProbeError = kBf16 ? 0.02 : 2e-5, kGradientError = kBf16 ? 0.06 : 1e-5;

  HashFieldTest() : field_(Small(kBf16), 5) {
    const std::span<float> table = TensorOf(&field_, "table"), weights = TensorOf(&field_, "weights");
    for (std::size_t i = 0; i < table.size(); ++i)  // features of useful size, so that no path is dead
      table[i] = io::Random(9, io::Stream::kInit, 2, i).Uniform() - 0.5f;
    reference_.table.assign(table.begin(), table.end());
    reference_.weights.assign(weights.begin(), weights.end());
    reference_.levels = field_.grid().levels();
    for (int s = 0; s < kSamples; ++s) {
      io::Random random(11, io::Stream::kInit, 3, 100 * static_cast<std::uint64_t>(s));
      samples_.x.push_back(random.Uniform());
      samples_.y.push_back(random.Uniform());
      samples_.z.push_back(random.Uniform());
      double norm = 0;
      for (float& d : directions_[s]) d = random.Uniform() - 0.5f, norm += d * d;
      for (float& d : directions_[s]) d = static_cast<float>(d / std::sqrt(norm));
      for (int c = 0; c < 3; ++c) a_.push_back(random.Uniform() - 0.5);
      b_.push_back(random.Uniform() - 0.5);
    }
  }

  HashNetwork<Real>& network() { return std::get<HashNetwork<Real>>(field_.network()); }

  void Forward(NetworkRows<Real>* rows) {
    rows->Resize(kSamples);
    field_.grid().Encode(samples_, 0, kSamples, rows->features.data());
    network().QueryDensity(rows);
    for (int s = 0; s < kSamples; ++s) network().SetDirection(directions_[s], s, s + 1, rows);
    network().QueryColour(rows);
  }

  HashField field_;
  Reference reference_;
  Samples samples_;
  float directions_[kSamples][3];
  Doubles a_, b_;
};
using Reals = testing::Types<float, kernels::Bf16>;
TYPED_TEST_SUITE(HashFieldTest, Reals);

TYPED_TEST(HashFieldTest, ForwardMatchesTheReference) {
  NetworkRows<TypeParam> rows;
  this->Forward(&rows);
  double sum = 0;
  for (std::size_t s = 0; s < kSamples; ++s) {
    sum += this->b_[s] * std::log(rows.sigma[s]);
    for (std::size_t c = 0; c < 3; ++c)
      sum += this->a_[3 * s + c] * std::log(rows.rgb[3 * s + c] / (1 - rows.rgb[3 * s + c]));
  }
  EXPECT_NEAR(
      sum, this->reference_.Probe(this->samples_, this->directions_, this->a_, this->b_), this->kProbeError);
}

TYPED_TEST(HashFieldTest, BackwardMatchesCentralDifferencesOfTheReference) {
  NetworkRows<TypeParam> rows;
  this->Forward(&rows);
  const std::vector<float> a(this->a_.begin(), this->a_.end()), b(this->b_.begin(), this->b_.end());
  std::vector<float> weight_gradients(this->network().n_weights(), 0.f);
  this->network().Backward(a.data(), b.data(), &rows, weight_gradients.data());

  // The probe is piecewise linear in each weight: a tiny step stays on one side of every ReLU.
  constexpr double kStep = 1e-7;
  const auto difference = [&](double* parameter) {
    const double value = *parameter;
    *parameter = value + kStep;
    const double above = this->reference_.Probe(this->samples_, this->directions_, this->a_, this->b_);
    *parameter = value - kStep;
    const double below = this->reference_.Probe(this->samples_, this->directions_, this->a_, this->b_);
    *parameter = value;
    return (above - below) / (2 * kStep);
  };
  double error = 0, norm = 0;
  int checked = 0;
  for (std::size_t i = 0; i < weight_gradients.size(); i += 13, ++checked) {
    const double exact = difference(&this->reference_.weights[i]);
    error += std::pow(weight_gradients[i] - exact, 2);
    norm += exact * exact;
  }
  EXPECT_GT(checked, 700);
  EXPECT_GT(norm, 1e-3);
  EXPECT_LE(std::sqrt(error / norm), this->kGradientError);

  // Table gradients: scatter the feature gradients in double and compare entry by entry.
  error = norm = 0;
  checked = 0;
  for (std::size_t l = 0; l < this->reference_.levels.size(); ++l) {
    const kernels::GridLevel& level = this->reference_.levels[l];
    Doubles gradient(level.n_entries * 4);
    for (std::size_t s = 0; s < kSamples; ++s) {
      double df[4];
      for (std::size_t f = 0; f < 4; ++f) df[f] = ref::Value(rows.features_gradient[32 * s + 4 * l + f]);
      const double x = this->samples_.x[s], y = this->samples_.y[s], z = this->samples_.z[s];
      ref::Scatter(level, df, &x, &y, &z, 1, gradient.data());
    }
    for (std::size_t i = 0; i < gradient.size(); ++i) {
      if (gradient[i] == 0) continue;
      const double exact = difference(&this->reference_.table[level.first_entry * 4 + i]);
      error += std::pow(gradient[i] - exact, 2);
      norm += exact * exact;
      ++checked;
    }
  }
  EXPECT_GT(checked, 500);
  EXPECT_LE(std::sqrt(error / norm), this->kGradientError);
}

TYPED_TEST(HashFieldTest, DensityIsFiniteAndGatedAtTheLimitOfTheExponent) {
  NetworkRows<TypeParam> rows;
  this->Forward(&rows);
  const std::span<float> weights = TensorOf(&this->field_, "weights");
  for (std::size_t i = Net::kW2; i < Net::kW3; ++i) weights[i] = 1e6f;
  this->field_.Refresh();
  this->network().QueryDensity(&rows);
  this->network().QueryColour(&rows);
  const std::vector<float> zero(3 * kSamples, 0.f), one(kSamples, 1.f);
  std::vector<float> weight_gradients(this->network().n_weights(), 0.f);
  this->network().Backward(zero.data(), one.data(), &rows, weight_gradients.data());
  for (std::size_t s = 0; s < kSamples; ++s) {
    EXPECT_NEAR(rows.sigma[s] / std::exp(15.0), 1, 1e-5);
    for (std::size_t f = 0; f < 32; ++f) EXPECT_EQ(ref::Value(rows.features_gradient[32 * s + f]), 0.f);
  }
}

}  // namespace
}  // namespace nerf
