// Adam of nerf/kernels: against the published equations in double, for vanishing gradients, and what float
// storage is for.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <type_traits>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "io/base/random.h"
#include "nerf/fields/hash_field.h"
#include "nerf/kernels/adam_reference.h"
#include "nerf/kernels/bf16.h"
#include "nerf/kernels/kernels.h"
#include "nerf/sampling/occupancy_grid.h"

namespace nerf {
namespace {

using Floats = std::vector<float>;
using kernels::AdamStep;
using kernels::Kernels;

void ForEachBuild(const std::function<void(const Kernels&)>& body) {
  for (const char* name : {"portable", "avx2", "avx512", "avx512bf16"}) {
    SCOPED_TRACE(name);
    if (const Kernels* build = kernels::FindKernels(name)) body(*build);
  }
}

AdamStep StepNumber(int t, float learning_rate) {
  AdamStep step{.learning_rate = learning_rate};
  step.correction1 = static_cast<float>(1 / (1 - std::pow(double{step.beta1}, t)));
  step.correction2 = static_cast<float>(1 / (1 - std::pow(double{step.beta2}, t)));
  return step;
}

// Algorithm 1 of Kingma and Ba 2015, one parameter.
struct PlainAdam {
  double m = 0, v = 0;

  // What the parameter loses in step t.
  double Change(double g, int t, const AdamStep& options) {
    const double beta1 = options.beta1, beta2 = options.beta2;
    m = beta1 * m + (1 - beta1) * g;
    v = beta2 * v + (1 - beta2) * g * g;
    const double m_hat = m / (1 - std::pow(beta1, t)), v_hat = v / (1 - std::pow(beta2, t));
    return double{options.learning_rate} * m_hat / (std::sqrt(v_hat) + double{options.epsilon});
  }
};

// Each step starts from the state in float, so that one step's error shows and not its history.
TEST(Adam, EveryStepEqualsThePlainEquationsInDouble) {
  constexpr std::size_t kCount = 10007;
  ForEachBuild([](const Kernels& build) {
    Floats g(kCount), m(kCount), v(kCount), values(kCount);
    double worst_moment = 0, worst_change = 0;
    for (int t = 1; t <= 100; ++t) {
      std::vector<PlainAdam> plain(kCount);
      std::vector<double> change(kCount);
      const AdamStep step = StepNumber(t, 1e-2f);
      for (std::size_t i = 0; i < kCount; ++i) {
        io::Random random(1, io::Stream::kInit, static_cast<std::uint64_t>(t), i);
        g[i] = (random.Uniform() - 0.3f) * std::ldexp(1.f, -static_cast<int>(i % 20));
        values[i] = 0;  // a change keeps all its digits
        plain[i] = {double{m[i]}, double{v[i]}};
        change[i] = g[i] == 0.f ? 0 : plain[i].Change(double{g[i]}, t, step);
      }
      const Floats gradients = g;
      build.adam(step, kCount, g.data(), m.data(), v.data(), values.data(), nullptr);
      for (std::size_t i = 0; i < kCount; ++i) {
        if (gradients[i] == 0.f) continue;
        // m may cancel: its error is measured by the terms that are added.
        const double m_scale = std::fabs(plain[i].m) + 0.1 * std::fabs(double{gradients[i]});
        worst_moment = std::max({worst_moment,
                                 std::fabs(double{m[i]} - plain[i].m) / m_scale,
                                 std::fabs(double{v[i]} / plain[i].v - 1)});
        const double change_scale = std::fabs(change[i]) * m_scale / std::fabs(plain[i].m);
        worst_change = std::max(worst_change, std::fabs(-double{values[i]} - change[i]) / change_scale);
      }
    }
    EXPECT_LE(worst_moment, 1e-6);
    EXPECT_LE(worst_change, 1e-6);
    EXPECT_GT(worst_change, 1e-9) << "the comparison did not run";
  });
}

TEST(Adam, LossCurveOfAQuadraticEqualsThatInDouble) {
  constexpr std::size_t kCount = 1000;
  ForEachBuild([](const Kernels& build) {
    const auto draw = [](std::uint64_t stream, std::size_t i) {
      return io::Random(2, io::Stream::kInit, stream, i).Uniform();
    };
    Floats g(kCount), m(kCount), v(kCount), values(kCount);
    std::vector<PlainAdam> plain(kCount);
    std::vector<double> exact(kCount);
    for (std::size_t i = 0; i < kCount; ++i) exact[i] = double{values[i] = draw(0, i)};
    for (int t = 1; t <= 10; ++t) {
      const AdamStep step = StepNumber(t, 1e-2f);
      double loss = 0, loss_exact = 0;
      for (std::size_t i = 0; i < kCount; ++i) {
        const double curvature = double{draw(1, i)}, target = double{draw(2, i)};
        loss += curvature * std::pow(double{values[i]} - target, 2);
        loss_exact += curvature * std::pow(exact[i] - target, 2);
        g[i] = static_cast<float>(2 * curvature * (double{values[i]} - target));
        exact[i] -= plain[i].Change(2 * curvature * (exact[i] - target), t, step);
      }
      EXPECT_NEAR(loss / loss_exact, 1, 1e-5) << t;
      build.adam(step, kCount, g.data(), m.data(), v.data(), values.data(), nullptr);
    }
  });
}

// Denormal numbers count as zero while this lives; does nothing on other processors.
class FlushDenormals {
 public:
  explicit FlushDenormals(bool on) {
#if defined(__x86_64__)
    saved_ = _mm_getcsr();
    _mm_setcsr(on ? saved_ | 0x8040u : saved_ & ~0x8040u);
#else
    (void)on;
#endif
  }
  ~FlushDenormals() {
#if defined(__x86_64__)
    _mm_setcsr(saved_);
#endif
  }
  FlushDenormals(const FlushDenormals&) = delete;

 private:
  unsigned saved_ = 0;
};

// The bound is that of Kingma and Ba, section 2.1. Where the square of a gradient underflows, epsilon
// keeps the step far below it.
TEST(Adam, StepsAreBoundedForGradientsOfAnySizeWithAndWithoutDenormals) {
  constexpr float kRate = 1e-2f;
  ForEachBuild([](const Kernels& build) {
    for (const bool flush : {false, true}) {
      const FlushDenormals mode(flush);
      for (int exponent = 3; exponent <= 25; ++exponent) {
        const float gradient = static_cast<float>(std::pow(10.0, -exponent));
        float m = 0, v = 0, value = 0;
        for (int t = 1; t <= 1000; ++t) {
          const float before = value;
          float g = gradient;
          build.adam(StepNumber(t, kRate), 1, &g, &m, &v, &value, nullptr);
          const float bound = std::max(1.f, 0.1f / std::sqrt(0.01f)) * kRate;
          ASSERT_TRUE(std::isfinite(value) && std::isfinite(m) && std::isfinite(v)) << gradient;
          ASSERT_LE(std::fabs(value - before), 1.0001f * bound) << gradient << " step " << t;
          if (v < 1.2e-38f) {
            ASSERT_LE(std::fabs(value - before), 1.0001f * kRate * gradient / 1e-15f)
                << "step from underflow";
          }
        }
      }
    }
  });
}

// A hash entry that no ray has met keeps every bit, wherever it lies among those that are.
TEST(Adam, ParametersWithoutGradientKeepEveryBit) {
  ForEachBuild([](const Kernels& build) {
    for (const std::size_t n : {1u, 15u, 16u, 17u, 64u, 131u}) {
      Floats g(n), m(n), v(n), values(n);
      for (std::size_t i = 0; i < n; ++i) {
        g[i] = i % 3 == 0 ? 0.f : i % 3 == 1 ? -0.f : 1e-3f;
        m[i] = 0.1f, v[i] = 0.2f, values[i] = i % 2 ? -0.f : 0.3f;
      }
      const Floats before = values;
      build.adam(StepNumber(5, 1e-2f), n, g.data(), m.data(), v.data(), values.data(), nullptr);
      for (std::size_t i = 0; i < n; ++i) {
        EXPECT_EQ(g[i], 0.f);
        const bool moved = std::memcmp(&values[i], &before[i], sizeof(float)) != 0;
        EXPECT_EQ(moved, i % 3 == 2) << i << " of " << n;
        EXPECT_EQ(m[i] == 0.1f && v[i] == 0.2f, i % 3 != 2) << i << " of " << n;
      }
    }
  });
}

// With 8 bits of mantissa the weight would stay at 1 and the moment at a quarter.
TEST(Adam, WeightsAndMomentsAreFloatsThatKeepSmallUpdates) {
  static_assert(
      std::is_same_v<decltype(Kernels::adam),
                     void (*)(const AdamStep&, std::size_t, float*, float*, float*, float*, kernels::Bf16*)>);
  static_assert(std::is_same_v<decltype(Tensor::values), std::span<float>>);
  ForEachBuild([](const Kernels& build) {
    float m = 0, v = 0, value = 1;
    for (int t = 1; t <= 4000; ++t) {
      AdamStep step = StepNumber(t, t <= 1000 ? 5e-4f : 0.f);
      step.beta2 = 0.999f;
      step.correction2 = static_cast<float>(1 / (1 - std::pow(0.999, t)));
      float g = 1;
      build.adam(step, 1, &g, &m, &v, &value, nullptr);
    }
    EXPECT_NEAR(value, 0.5, 1e-4);
    EXPECT_NEAR(v, 1 - std::pow(0.999, 4000), 1e-4);
  });
}

// Entries whose gradients are all zero, in runs and alone, at the start, in the middle and at the end.
bool IsUntouched(std::size_t entry, std::size_t n) {
  return entry % 3 == 0 || (entry >= 32 && entry < 70) || entry + 2 == n;
}

Floats EntryGradients(std::size_t n, int t) {
  Floats g(n * kernels::kFeatures);
  for (std::size_t i = 0; i < g.size(); ++i) {
    io::Random random(4, io::Stream::kInit, static_cast<std::uint64_t>(t), i);
    const std::size_t entry = i / kernels::kFeatures;
    // One feature alone may be zero.
    if (!IsUntouched(entry, n) && i % 7 != 0)
      g[i] = (random.Uniform() - 0.4f) * std::ldexp(1.f, -static_cast<int>(entry % 20));
  }
  return g;
}

// Each step starts from the state in float.
TEST(StepEntries, EveryStepEqualsTheReferenceInDoubleAndUntouchedEntriesKeepEveryBit) {
  ForEachBuild([](const Kernels& build) {
    for (const std::size_t n : {1u, 3u, 16u, 33u, 131u}) {
      Floats v(n), values(n * kernels::kFeatures, 0.3f);
      std::vector<kernels::Bf16> rounded(values.size() + 1, kernels::Bf16{0x7777});
      double worst = 0;
      for (int t = 1; t <= 50; ++t) {
        const AdamStep step = StepNumber(t, 1e-2f);
        const Floats before = values;
        Floats g = EntryGradients(n, t);
        std::vector<double> exact_g(g.begin(), g.end()), exact_v(v.begin(), v.end()),
            change(values.size(), 0.);
        build.step_entries(step, n, g.data(), v.data(), values.data(), rounded.data());
        kernels::reference::StepEntries(step, n, exact_g.data(), exact_v.data(), change.data());
        for (std::size_t i = 0; i < values.size(); ++i) {
          const std::size_t entry = i / kernels::kFeatures;
          ASSERT_EQ(g[i], 0.f);
          if (change[i] == 0) {
            ASSERT_EQ(values[i], before[i]) << i << " of " << n;
            continue;
          }
          ASSERT_EQ(rounded[i], kernels::reference::Rounded(values[i])) << i;
          // The change loses half an ulp of the value to which it is added.
          const double lost = std::fabs(double{values[i]} - (double{before[i]} + change[i])) - 3e-8;
          worst = std::max(
              {worst, lost / std::fabs(change[i]), std::fabs(double{v[entry]} / exact_v[entry] - 1)});
        }
      }
      for (std::size_t entry = 0; entry < n; ++entry)
        EXPECT_EQ(v[entry] == 0.f, IsUntouched(entry, n)) << entry;
      EXPECT_EQ(rounded.back(), kernels::Bf16{0x7777}) << "wrote past the end";
      EXPECT_LE(worst, 1e-6);
    }
  });
}

// The bound of Kingma and Ba, section 2.1, for a moment over all features of an entry: gradients in one
// feature alone, from the first step on and from late in a run on.
TEST(StepEntries, StepsAreBoundedForGradientsOfAnySize) {
  constexpr float kRate = 1e-2f;
  ForEachBuild([](const Kernels& build) {
    for (int exponent = 0; exponent <= 37; ++exponent) {
      for (const int first : {1, 1000}) {
        float v = 0, values[kernels::kFeatures] = {};
        for (int t = first; t <= first + 100; ++t) {
          float g[kernels::kFeatures] = {static_cast<float>(std::pow(10.0, -exponent))};
          const float before = values[0];
          build.step_entries(StepNumber(t, kRate), 1, g, &v, values, nullptr);
          ASSERT_TRUE(std::isfinite(values[0]) && std::isfinite(v)) << exponent;
          ASSERT_LE(std::fabs(values[0] - before), 1.001f * std::sqrt(4 / 0.01f) * kRate) << exponent;
          if (first == 1) {
            ASSERT_LE(std::fabs(values[0] - before), 2.001f * kRate) << exponent << " step " << t;
          }
          for (int f = 1; f < kernels::kFeatures; ++f) ASSERT_EQ(values[f], 0.f);
        }
      }
    }
  });
}

// The moving averages of the occupancy grid.
TEST(OccupancyGrid, DensityDecaysByItsPublishedFactors) {
  OccupancyGrid grid(64, SceneContraction{});
  grid.density()[7] = grid.density()[8] = 2;
  for (int i = 1; i <= 40; ++i) {
    grid.Visit(7, 0.f);
    grid.Probe(8, 0.f);
    ASSERT_NEAR(grid.density()[7] / (2 * std::pow(0.95, i)), 1, 1e-5);
    ASSERT_NEAR(grid.density()[8] / (2 * std::pow(0.8, i)), 1, 1e-5);
  }
  grid.Visit(7, 3.f);
  EXPECT_EQ(grid.density()[7], 3.f);
}

}  // namespace
}  // namespace nerf
