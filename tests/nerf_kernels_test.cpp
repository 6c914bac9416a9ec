// Every build of the kernels that this CPU runs, against the plain twin in double, within the bounds of
// kernels.h.
#include "nerf/kernels/kernels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "nerf/kernels/reference.h"
#include "nerf/random.h"

namespace nerf::kernels {
namespace {

using Floats = std::vector<float>;
using Doubles = std::vector<double>;

Floats Uniform(std::size_t n, std::uint64_t seed, float low = -1, float high = 1) {
  Floats values(n);
  for (std::size_t i = 0; i < n; ++i)
    values[i] = low + (high - low) * Random(seed, Stream::kInit, 0, i).Uniform();
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
                         testing::Values("portable", "avx2", "avx512"),
                         [](const auto& test) { return test.param; });

// N20
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

// N20
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

// N01
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

// N21
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

TEST_P(KernelsTest, MatmulAndItsGradientForAwkwardSizes) {
  for (const int n : {0, 1, 2, 3, 15, 16, 17, 63, 64, 65, 200}) {
    for (const auto& [k, m] : {std::pair{32, 64}, {64, 16}, {64, 64}, {16, 64}, {64, 32}}) {
      const auto un = static_cast<std::size_t>(n), uk = static_cast<std::size_t>(k),
                 um = static_cast<std::size_t>(m);
      const Floats x = Uniform(un * uk, 1), w = Uniform(uk * um, 2), mask = Uniform(un * um, 3),
                   dy = Uniform(un * um, 4);
      for (const Epilogue epilogue : {Epilogue::kNone, Epilogue::kRelu, Epilogue::kMask}) {
        Floats y(un * um + 1, 7.f);
        Doubles exact(un * um), bound(un * um);
        kernels_->matmul(n, k, m, x.data(), w.data(), epilogue, mask.data(), y.data());
        reference::Matmul(
            n, k, m, ToDouble(x).data(), ToDouble(w).data(), epilogue, ToDouble(mask).data(), exact.data());
        for (std::size_t i = 0; i < exact.size(); ++i) {
          // |x|, |w| <= 1, hence sum |x||w| <= k.
          ASSERT_NEAR(y[i], exact[i], 2.0 * k * 0x1p-24 * k) << n << " " << k << " " << m;
        }
        ASSERT_EQ(y.back(), 7.f) << "wrote past the end";
      }
      Floats gradient = Uniform(uk * um, 5);
      Doubles exact = ToDouble(gradient);
      kernels_->matmul_gradient(n, k, m, x.data(), dy.data(), gradient.data());
      reference::MatmulGradient(n, k, m, ToDouble(x).data(), ToDouble(dy).data(), exact.data());
      for (std::size_t i = 0; i < exact.size(); ++i)
        ASSERT_NEAR(gradient[i], exact[i], 2.0 * (n + 1) * 0x1p-24 * (n + 1));
    }
  }
}

// N27
TEST_P(KernelsTest, ReluAndMaskKeepNaN) {
  Floats x(16 * 32, std::nanf("")), w = Uniform(32 * 64, 1), y(16 * 64);
  kernels_->matmul(16, 32, 64, x.data(), w.data(), Epilogue::kRelu, nullptr, y.data());
  for (const float value : y) ASSERT_TRUE(std::isnan(value));
  const Floats mask(y.size(), 1.f);
  kernels_->matmul(16, 32, 64, x.data(), w.data(), Epilogue::kMask, mask.data(), y.data());
  for (const float value : y) ASSERT_TRUE(std::isnan(value));
}

TEST_P(KernelsTest, HeadAndItsGradient) {
  for (const int n : {0, 1, 5, 64}) {
    const auto un = static_cast<std::size_t>(n);
    const Floats x = Uniform(un * 64, 1), w = Uniform(3 * 64, 2), dl = Uniform(un * 3, 3);
    Floats logits(un * 3), dx(un * 64), dw(3 * 64, 0.5f);
    Doubles logits_exact(un * 3), dx_exact(un * 64), dw_exact(3 * 64, 0.5);
    kernels_->head(n, 64, x.data(), w.data(), logits.data());
    kernels_->head_gradient(n, 64, x.data(), w.data(), dl.data(), dx.data(), dw.data());
    reference::Head(n, 64, ToDouble(x).data(), ToDouble(w).data(), logits_exact.data());
    reference::HeadGradient(
        n, 64, ToDouble(x).data(), ToDouble(w).data(), ToDouble(dl).data(), dx_exact.data(), dw_exact.data());
    for (std::size_t i = 0; i < logits.size(); ++i)
      ASSERT_NEAR(logits[i], logits_exact[i], 128 * 64 * 0x1p-24);
    for (std::size_t i = 0; i < dx.size(); ++i) ASSERT_NEAR(dx[i], dx_exact[i], 1e-6);
    for (std::size_t i = 0; i < dw.size(); ++i) ASSERT_NEAR(dw[i], dw_exact[i], 2e-5);
  }
}

class GridKernelsTest : public KernelsTest {};
INSTANTIATE_TEST_SUITE_P(Builds,
                         GridKernelsTest,
                         testing::Values("portable", "avx2", "avx512"),
                         [](const auto& test) { return test.param; });

TEST_P(GridKernelsTest, EncodeAndScatterMatchTheTwinOnDenseAndHashedLevels) {
  for (const std::uint32_t mask : {0u, 1023u}) {
    GridLevel level{
        .resolution = mask ? 97u : 12u, .hash_mask = mask, .n_entries = mask ? 1024u : 13u * 13u * 13u};
    const int n = 501;
    Floats x = Uniform(n, 1, 0, 1), y = Uniform(n, 2, 0, 1), z = Uniform(n, 3, 0, 1);
    x[0] = y[0] = z[0] = 0;
    x[1] = y[1] = z[1] = 1;  // the far face belongs to the last cell
    const Floats table = Uniform(level.n_entries * kFeatures, 4), df = Uniform(n * kFeatures, 5);
    Floats features(n * 32, 9.f), gradient(table.size());
    Doubles features_exact(n * kFeatures), gradient_exact(table.size());
    kernels_->encode(level, table.data(), x.data(), y.data(), z.data(), n, features.data(), 32);
    kernels_->scatter(level, df.data(), x.data(), y.data(), z.data(), n, gradient.data());
    const Doubles xd = ToDouble(x), yd = ToDouble(y), zd = ToDouble(z);
    reference::Encode(
        level, ToDouble(table).data(), xd.data(), yd.data(), zd.data(), n, features_exact.data(), kFeatures);
    reference::Scatter(level, ToDouble(df).data(), xd.data(), yd.data(), zd.data(), n, gradient_exact.data());
    // Positions times 97 cells round by 4e-6 of a cell; values are at most 1.
    for (int i = 0; i < n; ++i) {
      for (int f = 0; f < kFeatures; ++f) {
        ASSERT_NEAR(features[static_cast<std::size_t>(32 * i + f)],
                    features_exact[static_cast<std::size_t>(kFeatures * i + f)],
                    4e-5);
      }
      ASSERT_EQ(features[static_cast<std::size_t>(32 * i + kFeatures)], 9.f);
    }
    for (std::size_t i = 0; i < gradient.size(); ++i) ASSERT_NEAR(gradient[i], gradient_exact[i], 2e-4);
  }
}

// N22, N23
TEST_P(GridKernelsTest, AdamMatchesTheTwinOverAHundredStepsAndSkipsUntouchedEntries) {
  const std::size_t n = 1003;
  Floats g, m(n), v(n), values = Uniform(n, 1);
  const Floats start = values;
  Doubles md(n), vd(n), exact = ToDouble(values);
  for (int t = 1; t <= 100; ++t) {
    AdamStep step{.learning_rate = 1e-2f};
    step.correction1 = static_cast<float>(1 / (1 - std::pow(0.9, t)));
    step.correction2 = static_cast<float>(1 / (1 - std::pow(0.99, t)));
    g = Uniform(n, static_cast<std::uint64_t>(100 + t), -1e-3f, 1e-3f);
    for (std::size_t i = 0; i < n; i += 3) g[i] = 0;
    for (std::size_t i = 32; i < 96; ++i) g[i] = 0;
    Doubles gd = ToDouble(g);
    kernels_->adam(step, n, g.data(), m.data(), v.data(), values.data());
    reference::Adam(step, n, gd.data(), md.data(), vd.data(), exact.data());
    for (const float left : g) ASSERT_EQ(left, 0.f);
  }
  for (std::size_t i = 0; i < n; ++i) {
    ASSERT_NEAR(values[i], exact[i], 1e-5);
    if (i % 3 == 0 || (i >= 32 && i < 96)) {
      ASSERT_EQ(values[i], start[i]);
    }
  }
}

// N22
TEST_P(GridKernelsTest, AdamStepIsBoundedForVanishingGradients) {
  for (float g0 = 1e-3f; g0 > 1e-19f; g0 *= 0.1f) {
    AdamStep step{.learning_rate = 1e-2f, .correction1 = 10, .correction2 = 100};
    Floats g = {g0}, m = {0}, v = {0}, value = {0};
    kernels_->adam(step, 1, g.data(), m.data(), v.data(), value.data());
    ASSERT_TRUE(std::isfinite(value[0]));
    ASSERT_LE(std::fabs(value[0]), 1.01f * step.learning_rate) << g0;
  }
}

// N33: each gradient is the transpose of its forward pass, <dy, A x> = <A^T dy, x>, in double.
TEST(Reference, GradientsAreTransposes) {
  const GridLevel level{.resolution = 11, .hash_mask = 255, .n_entries = 256};
  const int n = 60;
  Doubles position[3];
  for (std::uint64_t i = 0; i < 3; ++i) position[i] = ToDouble(Uniform(n, i, 0, 1));
  position[0][0] = 0, position[1][0] = 1, position[2][1] = 1;
  const Doubles table = ToDouble(Uniform(256 * kFeatures, 4)), df = ToDouble(Uniform(n * kFeatures, 5));
  Doubles features(df.size()), table_gradient(table.size());
  const double *x = position[0].data(), *y = position[1].data(), *z = position[2].data();
  reference::Encode(level, table.data(), x, y, z, n, features.data(), kFeatures);
  reference::Scatter(level, df.data(), x, y, z, n, table_gradient.data());
  const auto dot = [](const Doubles& a, const Doubles& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  };
  EXPECT_NEAR(dot(df, features), dot(table_gradient, table), 1e-12);

  const Doubles in = ToDouble(Uniform(n * 32, 6)), w = ToDouble(Uniform(32 * 16, 7)),
                dy = ToDouble(Uniform(n * 16, 8)), head = ToDouble(Uniform(3 * 32, 9)),
                dl = ToDouble(Uniform(n * 3, 10));
  Doubles out(dy.size()), dw(w.size()), logits(dl.size()), dx(in.size()), dhead(head.size());
  reference::Matmul<double>(n, 32, 16, in.data(), w.data(), Epilogue::kNone, nullptr, out.data());
  reference::MatmulGradient(n, 32, 16, in.data(), dy.data(), dw.data());
  EXPECT_NEAR(dot(dy, out), dot(dw, w), 1e-10);
  reference::Head(n, 32, in.data(), head.data(), logits.data());
  reference::HeadGradient(n, 32, in.data(), head.data(), dl.data(), dx.data(), dhead.data());
  EXPECT_NEAR(dot(dl, logits), dot(dhead, head), 1e-10);
  Doubles active = in;  // the gradient of the inputs passes where a ReLU had let them pass
  for (double& value : active) value = std::max(value, 0.0);
  reference::Head(n, 32, active.data(), head.data(), logits.data());
  EXPECT_NEAR(dot(dl, logits), dot(dx, active), 1e-10);
}

TEST(Dispatch, PortableIsAlwaysThereAndUnknownNamesAreNot) {
  EXPECT_NE(FindKernels("portable"), nullptr);
  EXPECT_EQ(FindKernels("sse9"), nullptr);
  EXPECT_NE(ActiveKernels().name, nullptr);
}

}  // namespace
}  // namespace nerf::kernels
