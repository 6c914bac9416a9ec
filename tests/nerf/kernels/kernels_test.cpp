// Every build of the kernels that this CPU runs, against the plain reference in double, within the bounds of
// kernels.h.
#include "nerf/kernels/kernels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "io/base/random.h"
#include "nerf/kernels/adam_reference.h"
#include "nerf/kernels/reference.h"

namespace nerf::kernels {
namespace {

using Floats = std::vector<float>;
using Doubles = std::vector<double>;

Floats Uniform(std::size_t n, std::uint64_t seed, float low = -1, float high = 1) {
  Floats values(n);
  for (std::size_t i = 0; i < n; ++i)
    values[i] = low + (high - low) * io::Random(seed, io::Stream::kInit, 0, i).Uniform();
  return values;
}
Doubles ToDouble(const Floats& v) { return {v.begin(), v.end()}; }

class KernelsTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    kernels_ = FindKernels(GetParam());
    if (!kernels_) GTEST_SKIP() << "this CPU lacks " << GetParam();
  }
  const Kernels* kernels_ = nullptr;
};

INSTANTIATE_TEST_SUITE_P(Builds,
                         KernelsTest,
                         testing::Values("portable", "avx2", "avx512", "avx512bf16"),
                         [](const auto& test) { return test.param; });

TEST_P(KernelsTest, ExpKeepsItsErrorBoundOverItsRange) {
  constexpr int kCount = 400001;
  Floats x(kCount);
  for (int i = 0; i < kCount; ++i)
    x[static_cast<std::size_t>(i)] = -87.f + 175.f * static_cast<float>(i) / (kCount - 1);
  Floats y = x;
  kernels_->exp(kCount, y.data());
  double worst = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    worst = std::max(worst, std::fabs(y[i] / std::exp(static_cast<double>(x[i])) - 1));
  EXPECT_LE(worst, 2.5e-7);
  EXPECT_GT(worst, 1e-9) << "the sweep did not run";
}

TEST_P(KernelsTest, ExpAtTheEndsOfItsRange) {
  const float inf = std::numeric_limits<float>::infinity();
  Floats x = {-1e30f, -inf, 200.f, inf, std::nanf(""), 0.f, -0.f};
  kernels_->exp(static_cast<int>(x.size()), x.data());
  EXPECT_LT(x[0], 2e-38f);
  EXPECT_LT(x[1], 2e-38f);
  EXPECT_GT(x[0], 0.f);
  EXPECT_TRUE(std::isfinite(x[2]) && std::isfinite(x[3]) && x[2] > 1e38f);
  EXPECT_TRUE(std::isnan(x[4]));
  EXPECT_EQ(x[5], 1.f);
  EXPECT_EQ(x[6], 1.f);
}

TEST_P(KernelsTest, OpacityIsAccurateFromTinyToHugeOpticalDepth) {
  Floats x;
  for (int binade = -40; binade <= 7; ++binade) {
    for (int i = 0; i < 2000; ++i) x.push_back(std::ldexp(1.f + static_cast<float>(i) / 2000.f, binade));
  }
  Floats y = x;
  kernels_->one_minus_exp_neg(static_cast<int>(y.size()), y.data());
  double worst = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    worst = std::max(worst, std::fabs(y[i] / -std::expm1(-static_cast<double>(x[i])) - 1));
  EXPECT_LE(worst, 5e-7);
  Floats ends = {0.f, 1e30f, std::numeric_limits<float>::infinity(), std::nanf("")};
  kernels_->one_minus_exp_neg(4, ends.data());
  EXPECT_EQ(ends[0], 0.f);
  EXPECT_EQ(ends[1], 1.f);
  EXPECT_EQ(ends[2], 1.f);
  EXPECT_TRUE(std::isnan(ends[3]));
}

TEST_P(KernelsTest, SigmoidStaysWithinItsBoundAndInsideTheUnitInterval) {
  Floats x = Uniform(100001, 3, -80, 80), y = x;
  kernels_->sigmoid(static_cast<int>(y.size()), y.data());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double exact = 1 / (1 + std::exp(-static_cast<double>(x[i])));
    ASSERT_NEAR(y[i] / exact, 1, 6e-7) << x[i];
  }
  Floats ends = {-200.f, 200.f, -104.f};
  kernels_->sigmoid(3, ends.data());
  for (const float value : ends) EXPECT_TRUE(value >= 0.f && value <= 1.f);
}

TEST_P(KernelsTest, AdamMatchesTheReferenceOverAHundredStepsAndSkipsUntouchedEntries) {
  const std::size_t n = 1003;
  Floats g, m(n), v(n), values = Uniform(n, 1);
  const Floats start = values;
  std::vector<Bf16> rounded(n + 1, Bf16{0x7777});
  Doubles md(n), vd(n), exact = ToDouble(values);
  for (int t = 1; t <= 100; ++t) {
    AdamStep step{.learning_rate = 1e-2f};
    step.correction1 = static_cast<float>(1 / (1 - std::pow(0.9, t)));
    step.correction2 = static_cast<float>(1 / (1 - std::pow(0.99, t)));
    g = Uniform(n, static_cast<std::uint64_t>(100 + t), -1e-3f, 1e-3f);
    for (std::size_t i = 0; i < n; i += 3) g[i] = 0;
    for (std::size_t i = 32; i < 96; ++i) g[i] = 0;
    Doubles gd = ToDouble(g);
    kernels_->adam(step, n, g.data(), m.data(), v.data(), values.data(), rounded.data());
    reference::Adam(step, n, gd.data(), md.data(), vd.data(), exact.data());
    for (const float left : g) ASSERT_EQ(left, 0.f);
  }
  for (std::size_t i = 0; i < n; ++i) {
    ASSERT_NEAR(values[i], exact[i], 1e-5);
    if (i % 3 == 0 || (i >= 32 && i < 96)) {
      ASSERT_EQ(values[i], start[i]);
    } else {
      ASSERT_EQ(rounded[i], reference::Rounded(values[i])) << i;
    }
  }
  ASSERT_EQ(rounded[n], Bf16{0x7777}) << "wrote past the end";
}

TEST_P(KernelsTest, AdamStepIsBoundedForVanishingGradients) {
  for (float g0 = 1e-3f; g0 > 1e-19f; g0 *= 0.1f) {
    AdamStep step{.learning_rate = 1e-2f, .correction1 = 10, .correction2 = 100};
    Floats g = {g0}, m = {0}, v = {0}, value = {0};
    kernels_->adam(step, 1, g.data(), m.data(), v.data(), value.data(), nullptr);
    ASSERT_TRUE(std::isfinite(value[0]));
    ASSERT_LE(std::fabs(value[0]), 1.01f * step.learning_rate) << g0;
  }
}

TEST(Dispatch, PortableIsAlwaysThereAndUnknownNamesAreNot) {
  EXPECT_NE(FindKernels("portable"), nullptr);
  EXPECT_EQ(FindKernels("sse9"), nullptr);
  EXPECT_NE(ActiveKernels().name, nullptr);
}

}  // namespace
}  // namespace nerf::kernels
