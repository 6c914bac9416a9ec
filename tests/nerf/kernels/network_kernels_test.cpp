// Products, look-ups and their gradients of every build of the kernels that this CPU runs, in float and in
// bfloat16, against the plain reference in double, within the bounds of kernels.h.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "io/base/random.h"
#include "nerf/kernels/kernels.h"
#include "nerf/kernels/reference.h"

namespace nerf::kernels {
namespace {

using Doubles = std::vector<double>;

// Rounding to bfloat16 changes a value by at most this share of it.
template <typename Real>
constexpr double kRounding = sizeof(Real) == 2 ? 0x1p-8 : 0;

template <typename Real>
std::vector<Real> ToReal(const std::vector<float>& v) {
  if constexpr (sizeof(Real) == 4) {
    return v;
  } else {
    std::vector<Real> rounded;
    for (const float value : v) rounded.push_back(reference::Rounded(value));
    return rounded;
  }
}
template <typename Real>
Doubles ToDouble(const std::vector<Real>& v) {
  Doubles values;
  for (const Real value : v) values.push_back(reference::Value(value));
  return values;
}

// Uniform in [low, high], exact in Real.
template <typename Real>
std::vector<Real> Uniform(std::size_t n, std::uint64_t seed, float low = -1, float high = 1) {
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i)
    values[i] = low + (high - low) * io::Random(seed, io::Stream::kInit, 0, i).Uniform();
  return ToReal<Real>(values);
}

template <typename T>
class NetworkKernelsTest : public testing::Test {
 protected:
  // Calls body(build, kernels) for every build that runs here.
  template <typename Body>
  void ForEachBuild(const Body& body) {
    int n_builds = 0;
    for (const char* name : {"portable", "avx2", "avx512", "avx512bf16"}) {
      const Kernels* build = FindKernels(name);
      if (!build) continue;
      SCOPED_TRACE(name);
      body(build->Network<T>());
      ++n_builds;
    }
    EXPECT_GT(n_builds, 0);
  }
};
using Reals = testing::Types<float, Bf16>;
TYPED_TEST_SUITE(NetworkKernelsTest, Reals);

TYPED_TEST(NetworkKernelsTest, ProductsAndTheirGradientsForAwkwardSizes) {
  using Real = TypeParam;
  this->ForEachBuild([](const NetworkKernels<Real>& kernels) {
    for (const int n : {0, 1, 2, 3, 15, 16, 17, 63, 64, 65, 200}) {
      for (const auto& [k, m] : {std::pair{32, 64}, {64, 16}, {64, 64}, {16, 64}, {64, 32}}) {
        SCOPED_TRACE(std::to_string(n) + " " + std::to_string(k) + " " + std::to_string(m));
        const auto un = static_cast<std::size_t>(n), uk = static_cast<std::size_t>(k),
                   um = static_cast<std::size_t>(m);
        const std::vector<Real> x = Uniform<Real>(un * uk, 1), mask = Uniform<Real>(un * um, 3),
                                dy = Uniform<Real>(un * um, 4);
        const std::vector<float> w = Uniform<float>(uk * um, 2);
        const Doubles w_exact = ToDouble(ToReal<Real>(w));
        std::vector<Real> packed(w.size());
        kernels.pack(k, m, w.data(), packed.data());
        // |x|, |w| <= 1, hence sum |x||w| <= k.
        const double bound = 2.0 * k * 0x1p-24 * k;
        Doubles exact(un * um);
        const auto expect = [&, rows = k, columns = m](Epilogue epilogue) {
          reference::Matmul(n,
                            rows,
                            columns,
                            ToDouble(x).data(),
                            w_exact.data(),
                            epilogue,
                            ToDouble(mask).data(),
                            exact.data());
        };
        for (const Epilogue epilogue : {Epilogue::kNone, Epilogue::kRelu, Epilogue::kMask}) {
          std::vector<Real> y(un * um + 1, ToReal<Real>({7.f})[0]);
          kernels.matmul(n, k, m, x.data(), packed.data(), epilogue, mask.data(), y.data());
          expect(epilogue);
          for (std::size_t i = 0; i < exact.size(); ++i) {
            ASSERT_NEAR(reference::Value(y[i]), exact[i], bound + kRounding<Real> * std::fabs(exact[i]));
          }
          ASSERT_EQ(reference::Value(y.back()), 7.f) << "wrote past the end";
        }
        std::vector<float> sums(un * um + 1, 7.f);
        kernels.matmul_sums(n, k, m, x.data(), packed.data(), sums.data());
        expect(Epilogue::kNone);
        for (std::size_t i = 0; i < exact.size(); ++i) ASSERT_NEAR(sums[i], exact[i], bound);
        ASSERT_EQ(sums.back(), 7.f) << "wrote past the end";

        std::vector<float> gradient = Uniform<float>(uk * um, 5);
        Doubles gradient_exact = ToDouble(gradient);
        kernels.matmul_gradient(n, k, m, x.data(), dy.data(), gradient.data());
        reference::MatmulGradient(n, k, m, ToDouble(x).data(), ToDouble(dy).data(), gradient_exact.data());
        for (std::size_t i = 0; i < gradient_exact.size(); ++i)
          ASSERT_NEAR(gradient[i], gradient_exact[i], 2.0 * (n + 1) * 0x1p-24 * (n + 1));
      }
    }
  });
}

TYPED_TEST(NetworkKernelsTest, ReluMaskAndRoundingKeepNaN) {
  using Real = TypeParam;
  this->ForEachBuild([](const NetworkKernels<Real>& kernels) {
    // The least NaN has no bit set that bfloat16 keeps.
    const float least_nan = std::bit_cast<float>(0x7f800001u);
    std::vector<float> values(16 * 32, least_nan);
    std::vector<Real> x(values.size()), packed(32 * 64), y(16 * 64);
    kernels.round(16, 32, values.data(), x.data(), 32);
    for (const Real value : x) ASSERT_TRUE(std::isnan(reference::Value(value)));
    EXPECT_FALSE(kernels.all_finite(16 * 32, x.data()));
    kernels.pack(32, 64, Uniform<float>(32 * 64, 1).data(), packed.data());
    kernels.matmul(16, 32, 64, x.data(), packed.data(), Epilogue::kRelu, nullptr, y.data());
    for (const Real value : y) ASSERT_TRUE(std::isnan(reference::Value(value)));
    const std::vector<Real> mask(y.size(), ToReal<Real>({1.f})[0]);
    kernels.matmul(16, 32, 64, x.data(), packed.data(), Epilogue::kMask, mask.data(), y.data());
    for (const Real value : y) ASSERT_TRUE(std::isnan(reference::Value(value)));
  });
}

TYPED_TEST(NetworkKernelsTest, OneValueThatIsNotFiniteIsFoundAnywhere) {
  using Real = TypeParam;
  this->ForEachBuild([](const NetworkKernels<Real>& kernels) {
    const float inf = std::numeric_limits<float>::infinity();
    std::vector<Real> values = Uniform<Real>(64, 1, -1e38f, 1e38f);
    EXPECT_TRUE(kernels.all_finite(64, values.data()));
    for (const float bad : {inf, -inf, std::nanf("")}) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        std::vector<Real> with = values;
        with[i] = ToReal<Real>({bad})[0];
        ASSERT_FALSE(kernels.all_finite(64, with.data())) << i;
      }
    }
  });
}

TYPED_TEST(NetworkKernelsTest, RoundingIsToNearestEvenAndKeepsTheStride) {
  using Real = TypeParam;
  this->ForEachBuild([](const NetworkKernels<Real>& kernels) {
    std::vector<float> values;
    for (std::uint32_t bits = 0x3f7f0000u; bits < 0x3f7f0000u + 64 * 0x1000u; bits += 0x1000u)
      values.push_back(std::bit_cast<float>(bits));  // every sixteenth of a step, ties as well
    std::vector<Real> rows(4 * 48, ToReal<Real>({7.f})[0]);
    kernels.round(4, 16, values.data(), rows.data(), 48);
    for (std::size_t i = 0; i < 4 * 48; ++i) {
      const float expected =
          i % 48 < 16 ? reference::Value(ToReal<Real>({values[i / 48 * 16 + i % 48]})[0]) : 7.f;
      ASSERT_EQ(reference::Value(rows[i]), expected) << i;
    }
  });
}

TYPED_TEST(NetworkKernelsTest, HeadAndItsGradient) {
  using Real = TypeParam;
  this->ForEachBuild([](const NetworkKernels<Real>& kernels) {
    for (const int n : {0, 1, 5, 64}) {
      const auto un = static_cast<std::size_t>(n);
      const std::vector<Real> x = Uniform<Real>(un * 64, 1);
      const std::vector<float> w = Uniform<float>(3 * 64, 2), dl = Uniform<float>(un * 3, 3);
      std::vector<float> logits(un * 3), dw(3 * 64, 0.5f);
      std::vector<Real> dx(un * 64);
      Doubles logits_exact(un * 3), dx_exact(un * 64), dw_exact(3 * 64, 0.5);
      kernels.head(n, 64, x.data(), w.data(), logits.data());
      kernels.head_gradient(n, 64, x.data(), w.data(), dl.data(), dx.data(), dw.data());
      reference::Head(n, 64, ToDouble(x).data(), ToDouble(w).data(), logits_exact.data());
      reference::HeadGradient(n,
                              64,
                              ToDouble(x).data(),
                              ToDouble(w).data(),
                              ToDouble(dl).data(),
                              dx_exact.data(),
                              dw_exact.data());
      for (std::size_t i = 0; i < logits.size(); ++i)
        ASSERT_NEAR(logits[i], logits_exact[i], 128 * 64 * 0x1p-24);
      for (std::size_t i = 0; i < dx.size(); ++i)
        ASSERT_NEAR(reference::Value(dx[i]), dx_exact[i], 1e-6 + kRounding<Real> * std::fabs(dx_exact[i]));
      for (std::size_t i = 0; i < dw.size(); ++i) ASSERT_NEAR(dw[i], dw_exact[i], 2e-5);
    }
  });
}

TYPED_TEST(NetworkKernelsTest, EncodeAndScatterMatchTheReferenceOnDenseAndHashedLevels) {
  using Real = TypeParam;
  this->ForEachBuild([](const NetworkKernels<Real>& kernels) {
    for (const std::uint32_t mask : {0u, 1023u}) {
      const GridLevel level{
          .resolution = mask ? 97u : 12u, .hash_mask = mask, .n_entries = mask ? 1024u : 13u * 13u * 13u};
      const int n = 501;
      std::vector<float> x = Uniform<float>(n, 1, 0, 1), y = Uniform<float>(n, 2, 0, 1),
                         z = Uniform<float>(n, 3, 0, 1);
      x[0] = y[0] = z[0] = 0;
      x[1] = y[1] = z[1] = 1;  // the far face belongs to the last cell
      const std::vector<float> table = Uniform<float>(level.n_entries * kFeatures, 4);
      const std::vector<Bf16> table_bf16 = ToReal<Bf16>(table);
      const std::vector<Real> df = Uniform<Real>(n * kFeatures, 5);
      const Doubles xd = ToDouble(x), yd = ToDouble(y), zd = ToDouble(z);
      // Positions times 97 cells round by 4e-6 of a cell; values are at most 1.
      const auto expect_features = [&](const Doubles& exact_table, const auto& encode) {
        std::vector<Real> features(n * 32, ToReal<Real>({9.f})[0]);
        Doubles exact(n * kFeatures);
        encode(features.data());
        reference::Encode(
            level, exact_table.data(), xd.data(), yd.data(), zd.data(), n, exact.data(), kFeatures);
        for (int i = 0; i < n; ++i) {
          for (int f = 0; f < kFeatures; ++f) {
            const double value = exact[static_cast<std::size_t>(kFeatures * i + f)];
            ASSERT_NEAR(reference::Value(features[static_cast<std::size_t>(32 * i + f)]),
                        value,
                        4e-5 + kRounding<Real> * std::fabs(value));
          }
          ASSERT_EQ(reference::Value(features[static_cast<std::size_t>(32 * i + kFeatures)]), 9.f);
        }
      };
      expect_features(ToDouble(table), [&](Real* features) {
        kernels.encode(level, table.data(), x.data(), y.data(), z.data(), n, features, 32);
      });
      expect_features(ToDouble(table_bf16), [&](Real* features) {
        kernels.encode_bf16(level, table_bf16.data(), x.data(), y.data(), z.data(), n, features, 32);
      });
      std::vector<float> gradient(table.size());
      Doubles gradient_exact(table.size());
      kernels.scatter(level, df.data(), x.data(), y.data(), z.data(), n, gradient.data());
      reference::Scatter(
          level, ToDouble(df).data(), xd.data(), yd.data(), zd.data(), n, gradient_exact.data());
      for (std::size_t i = 0; i < gradient.size(); ++i) ASSERT_NEAR(gradient[i], gradient_exact[i], 2e-4);
      // Slopes differ from cell to cell: where rounding can put a position into the next one, they are not
      // compared.
      const auto near_a_face = [&](float p) {
        const double scaled = double{p} * level.resolution;
        return std::fabs(scaled - std::round(scaled)) < 1e-4;
      };
      const auto expect_slopes = [&](const Doubles& exact_table, const auto& differentiate) {
        std::vector<float> slopes[3];
        Doubles exact[3];
        for (int axis = 0; axis < 3; ++axis) slopes[axis].assign(n, 0.5f), exact[axis].assign(n, 0.5);
        float* const to[3] = {slopes[0].data(), slopes[1].data(), slopes[2].data()};
        double* const exact_to[3] = {exact[0].data(), exact[1].data(), exact[2].data()};
        differentiate(to);
        reference::PositionGradient(
            level, exact_table.data(), ToDouble(df).data(), xd.data(), yd.data(), zd.data(), n, exact_to);
        int compared = 0;
        for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
          if (near_a_face(x[i]) || near_a_face(y[i]) || near_a_face(z[i])) continue;
          for (int axis = 0; axis < 3; ++axis)
            ASSERT_NEAR(slopes[axis][i], exact[axis][i], 1e-4 * level.resolution) << i;
          ++compared;
        }
        ASSERT_GT(compared, n - 20);
      };
      expect_slopes(ToDouble(table), [&](float* const to[3]) {
        kernels.position_gradient(level, table.data(), df.data(), x.data(), y.data(), z.data(), n, to);
      });
      expect_slopes(ToDouble(table_bf16), [&](float* const to[3]) {
        kernels.position_gradient_bf16(
            level, table_bf16.data(), df.data(), x.data(), y.data(), z.data(), n, to);
      });
    }
  });
}

// Trilinear values are linear along each axis within a cell, so central differences are exact.
TEST(Reference, PositionGradientIsTheSlopeOfTheFeatures) {
  for (const std::uint32_t mask : {0u, 255u}) {
    const GridLevel level{.resolution = 5, .hash_mask = mask, .n_entries = 256};
    const Doubles table = ToDouble(Uniform<float>(256 * kFeatures, 4)),
                  df = ToDouble(Uniform<float>(kFeatures, 5));
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      double position[3], slopes[3] = {0, 0, 0};
      for (std::uint64_t i = 0; i < 3; ++i)  // inside a cell
        position[i] = (static_cast<double>((seed * (i + 3)) % 5) + 0.1 +
                       0.8 * Uniform<float>(1, 9 * seed + i, 0, 1)[0]) /
                      5;
      double* const to[3] = {&slopes[0], &slopes[1], &slopes[2]};
      reference::PositionGradient(
          level, table.data(), df.data(), &position[0], &position[1], &position[2], 1, to);
      for (int axis = 0; axis < 3; ++axis) {
        const auto value = [&](double step) {
          double at[3] = {position[0], position[1], position[2]}, features[kFeatures];
          at[axis] += step;
          reference::Encode(level, table.data(), &at[0], &at[1], &at[2], 1, features, kFeatures);
          return std::inner_product(features, features + kFeatures, df.begin(), 0.0);
        };
        ASSERT_NEAR(slopes[axis], (value(1e-3) - value(-1e-3)) / 2e-3, 1e-9) << seed;
      }
    }
  }
}

// Each gradient is the transpose of its forward pass, <dy, A x> = <A^T dy, x>, in double.
TEST(Reference, GradientsAreTransposes) {
  const GridLevel level{.resolution = 11, .hash_mask = 255, .n_entries = 256};
  const int n = 60;
  Doubles position[3];
  for (std::uint64_t i = 0; i < 3; ++i) position[i] = ToDouble(Uniform<float>(n, i, 0, 1));
  position[0][0] = 0, position[1][0] = 1, position[2][1] = 1;
  const Doubles table = ToDouble(Uniform<float>(256 * kFeatures, 4)),
                df = ToDouble(Uniform<float>(n * kFeatures, 5));
  Doubles features(df.size()), table_gradient(table.size());
  const double *x = position[0].data(), *y = position[1].data(), *z = position[2].data();
  reference::Encode(level, table.data(), x, y, z, n, features.data(), kFeatures);
  reference::Scatter(level, df.data(), x, y, z, n, table_gradient.data());
  const auto dot = [](const Doubles& a, const Doubles& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  };
  EXPECT_NEAR(dot(df, features), dot(table_gradient, table), 1e-12);

  const Doubles in = ToDouble(Uniform<float>(n * 32, 6)), w = ToDouble(Uniform<float>(32 * 16, 7)),
                dy = ToDouble(Uniform<float>(n * 16, 8)), head = ToDouble(Uniform<float>(3 * 32, 9)),
                dl = ToDouble(Uniform<float>(n * 3, 10));
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

}  // namespace
}  // namespace nerf::kernels
