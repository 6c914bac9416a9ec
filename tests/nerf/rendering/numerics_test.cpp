// Numerical hazards of volume rendering in float, from elementary functions to the loss: tiny and huge
// optical depths, underflow, early termination, NaN. Oracles are in double or closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "io/base/random.h"
#include "nerf/fields/density_activation.h"
#include "nerf/kernels/kernels.h"
#include "nerf/rendering/volume_rendering.h"
#include "nerf/sampling/quadrature.h"
#include "tests/support/files/temp_dir.h"

namespace nerf {
namespace {

using Floats = std::vector<float>;
using kernels::Kernels;
constexpr float kInf = std::numeric_limits<float>::infinity(), kNaN = std::numeric_limits<float>::quiet_NaN();

double Ulps(float value, double exact) {
  const int exponent = exact == 0 ? -126 : std::max(std::ilogb(exact), -126);
  return std::fabs(static_cast<double>(value) - exact) / std::ldexp(1.0, exponent - 23);
}

void ForEachBuild(const std::function<void(const Kernels&)>& body) {
  for (const char* name : {"portable", "avx2", "avx512"}) {
    SCOPED_TRACE(name);
    if (const Kernels* build = kernels::FindKernels(name)) body(*build);
  }
}

using Function = void (*)(int n, float* values);

// Worst error over x in units in the last place.
double WorstUlps(Function function, const Floats& x, const std::function<double(double)>& exact) {
  Floats y = x;
  function(static_cast<int>(y.size()), y.data());
  double worst = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    worst = std::max(worst, Ulps(y[i], exact(static_cast<double>(x[i]))));
  return worst;
}

Floats Sweep(float first, float last, int n) {
  Floats x;
  for (int i = 0; i < n; ++i)
    x.push_back(first + (last - first) * (static_cast<float>(i) / static_cast<float>(n - 1)));
  return x;
}

Floats OpticalDepthsOfAllBinades() {
  Floats x;
  for (int binade = -40; binade <= 7; ++binade) {
    for (std::uint64_t i = 0; i < 2084; ++i)
      x.push_back(std::ldexp(
          1 + io::Random(1, io::Stream::kInit, static_cast<std::uint64_t>(binade + 40), i).Uniform(),
          binade));
  }
  return x;
}

TEST(Numerics, OpacityHoldsFourUlpInEveryBinade) {
  const Floats x = OpticalDepthsOfAllBinades();
  ASSERT_GE(x.size(), 100000u);
  const auto exact = [](double tau) { return -std::expm1(-tau); };
  ForEachBuild([&](const Kernels& build) { EXPECT_LE(WorstUlps(build.one_minus_exp_neg, x, exact), 4); });
  for (const float tau : x) ASSERT_LE(Ulps(-std::expm1(-tau), exact(static_cast<double>(tau))), 4) << tau;
}

// Below -87 the kernels return the least they can without denormal numbers, so flushing these to zero
// changes nothing.
TEST(Numerics, ExponentialHoldsTwoUlpAndIsNeverDenormal) {
  Floats x = Sweep(-87.f, 88.f, 1000001);
  for (float tiny = 1; tiny > 1e-40f; tiny *= 0.7f) x.push_back(tiny), x.push_back(-tiny);
  ForEachBuild([&](const Kernels& build) {
    EXPECT_LE(WorstUlps(build.exp, x, [](double v) { return std::exp(v); }), 2);
    Floats low = Sweep(-200.f, -87.f, 10001);
    build.exp(static_cast<int>(low.size()), low.data());
    for (const float value : low) ASSERT_TRUE(std::isnormal(value) && value < 2e-38f) << value;
  });
}

TEST(Numerics, SigmoidAndSoftplusHoldFourUlpAndDoNotOverflow) {
  const auto sigmoid = [](double x) { return 1 / (1 + std::exp(-x)); };
  ForEachBuild([&](const Kernels& build) {
    EXPECT_LE(WorstUlps(build.sigmoid, Sweep(-87.f, 200.f, 500001), sigmoid), 4);
    Floats low = Sweep(-200.f, -87.f, 10001);
    build.sigmoid(static_cast<int>(low.size()), low.data());
    for (const float value : low) ASSERT_TRUE(value >= 0.f && value < 2e-38f) << value;
  });
  for (int i = -200 * 64; i <= 200 * 64; ++i) {  // on this grid the shift of the softplus is exact
    const float x = static_cast<float>(i) / 64.f;
    const double y = static_cast<double>(x) - kDensityShift;
    ASSERT_LE(Ulps(Sigmoid(x), sigmoid(static_cast<double>(x))), 4) << x;
    ASSERT_LE(Ulps(Density(DensityActivation::kSoftplus, x),
                   std::max(y, 0.0) + std::log1p(std::exp(-std::fabs(y)))),
              4)
        << x;
    ASSERT_LE(Ulps(DensityGradient(DensityActivation::kSoftplus, x), sigmoid(y)), 4) << x;
  }
  EXPECT_GE(Sigmoid(-104.f), 0.f);
  EXPECT_EQ(Sigmoid(-kInf), 0.f);
  EXPECT_EQ(Sigmoid(kInf), 1.f);
}

TEST(Numerics, ExponentialDensityIsFiniteAndMonotoneAndEndsAtItsLimit) {
  float last = 0;
  for (int i = -2000; i <= 2000; ++i) {
    const float x = static_cast<float>(i) / 10.f, sigma = Density(DensityActivation::kExp, x);
    const float gradient = DensityGradient(DensityActivation::kExp, x);
    ASSERT_TRUE(std::isfinite(sigma) && std::isfinite(gradient)) << x;
    ASSERT_GE(sigma, last) << x;
    ASSERT_EQ(gradient, x - 1.f > 15.f ? 0.f : sigma) << x;
    last = sigma;
  }
  EXPECT_EQ(last, std::exp(15.f));
  EXPECT_TRUE(std::isnan(Density(DensityActivation::kExp, std::nanf(""))));
}

template <typename Scalar>
void CheckActivation(DensityActivation activation) {
  Scalar last = 0, last_gradient = 0;
  for (int i = -2000; i <= 2000; ++i) {
    const Scalar x = static_cast<Scalar>(i) / Scalar(10);
    const Scalar sigma = Density(activation, x), gradient = DensityGradient(activation, x);
    ASSERT_TRUE(std::isfinite(sigma) && std::isfinite(gradient)) << x;
    ASSERT_GE(sigma, last) << x;
    ASSERT_GE(gradient, last_gradient) << x;
    ASSERT_LE(gradient, Scalar(1)) << x;
    last = sigma, last_gradient = gradient;
  }
  EXPECT_NEAR(last, activation == DensityActivation::kRelu ? 200 : 199, 1e-4);
  EXPECT_EQ(last_gradient, Scalar(1));
}

TEST(Numerics, DensityAndItsGradientAreFiniteAndMonotone) {
  for (const DensityActivation activation : {DensityActivation::kSoftplus, DensityActivation::kRelu}) {
    CheckActivation<float>(activation);
    CheckActivation<double>(activation);
  }
  EXPECT_GT(Density(DensityActivation::kSoftplus, -80.f), 0.f);
  EXPECT_GT(DensityGradient(DensityActivation::kSoftplus, -80.f), 0.f);
}

TEST(Numerics, DensityGradientEqualsCentralDifferences) {
  constexpr double kStep = 1e-6;
  for (const DensityActivation activation : {DensityActivation::kSoftplus, DensityActivation::kRelu}) {
    for (double x = -30.05; x < 30; x += 0.1) {  // passes the kink of the ReLU at a distance
      const double difference =
          (Density(activation, x + kStep) - Density(activation, x - kStep)) / (2 * kStep);
      ASSERT_NEAR(DensityGradient(activation, x), difference, 1e-8) << x;
    }
  }
}

TEST(Numerics, EveryPairOfDensityAndLengthGivesFiniteLightAndGradients) {
  const Kernels& kernels = kernels::ActiveKernels();
  const PixelTarget target = {{0.2f, 0.1f, 0.4f}, 0.6f};
  const float background[3] = {1, 0, 0.5f};
  for (const float sigma : {0.f, 1e-30f, 1e-10f, 1.f, 1e10f, 1e30f}) {
    for (const float delta : {1e-30f, 1e-10f, 1.f, 1e10f}) {
      for (std::size_t place = 0; place < 3; ++place) {
        Floats tau = {0.5f, 0.5f, 0.5f}, rgb = {0, 0.5f, 1, 1, 0, 0.5f, 0.5f, 1, 0};
        tau[place] = sigma * delta;  // up to infinity
        Floats alpha = tau;
        kernels.one_minus_exp_neg(3, alpha.data());
        Floats weights = alpha;
        const float end = WeightsFromOpacities(3, tau.data(), weights.data());
        if (tau[place] >= 104) {
          EXPECT_EQ(alpha[place], 1.f);
          EXPECT_EQ(end, 0.f);
        }
        float colour[3], rgb_gradients[9], tau_gradients[3];
        CompositeColour(3, weights.data(), rgb.data(), colour);
        for (const PixelLoss<float>& pixel : {RandomBackgroundLoss(colour, end, target),
                                              FixedBackgroundLoss(colour, end, target, background)}) {
          CompositeGradients(3, weights.data(), rgb.data(), end, pixel, 1.f, rgb_gradients, tau_gradients);
          ASSERT_TRUE(std::isfinite(pixel.loss));
          for (const float g : rgb_gradients) ASSERT_TRUE(std::isfinite(g)) << sigma << " " << delta;
          for (const float g : tau_gradients) ASSERT_TRUE(std::isfinite(g)) << sigma << " " << delta;
        }
      }
    }
  }
  EXPECT_EQ(0.f * static_cast<float>(kOpenEnd), 0.f) << "an infinite length would give NaN in empty space";
}

Floats WeightsOf(const Floats& tau, float* end) {
  Floats weights = tau;
  kernels::ActiveKernels().one_minus_exp_neg(static_cast<int>(tau.size()), weights.data());
  *end = WeightsFromOpacities(static_cast<int>(tau.size()), tau.data(), weights.data());
  return weights;
}

// Before each sample: the weight that it would have with an opacity of 1.
Floats TransmittancesOf(const Floats& tau, float* end) {
  Floats transmittances(tau.size(), 1.f);
  *end = WeightsFromOpacities(static_cast<int>(tau.size()), tau.data(), transmittances.data());
  return transmittances;
}

TEST(Numerics, TransmittanceFallsSteadilyAndOpacityIsThatOfTheClosedForm) {
  constexpr int kCount = 1024;
  for (double total = 1e-6; total <= 200; total *= 1.3) {
    const Floats tau(kCount, static_cast<float>(total / kCount));
    float last;
    const Floats transmittance = TransmittancesOf(tau, &last);
    for (std::size_t i = 1; i < kCount; ++i) {
      ASSERT_GE(transmittance[i], 0.f);
      ASSERT_LE(transmittance[i], transmittance[i - 1]);
    }
    ASSERT_LE(last, transmittance.back());
    float end;
    double opacity = 0, depth = 0;
    for (const float w : WeightsOf(tau, &end)) opacity += static_cast<double>(w);
    for (const float t : tau) depth += static_cast<double>(t);
    ASSERT_NEAR(opacity / -std::expm1(-depth), 1, 1e-6 + kCount * 6e-8) << total;
  }
}

// 1 - sum of weights has no digit left behind an opaque surface, and may be negative.
TEST(Numerics, WeightsSumToAtMostOneAndTheBackgroundIsTheClosedForm) {
  constexpr int kRays = 100000, kSamples = 192;
  Floats tau(kSamples);
  double greatest = 0;
  for (std::uint64_t ray = 0; ray < kRays; ++ray) {
    io::Random random(ray, io::Stream::kInit, 0, 0);
    const float scale = std::exp(9.f * random.Uniform() - 10.f);  // depths of 0.004 to 35
    double depth = 0, sum = 0;
    for (float& t : tau) t = scale * random.Uniform(), depth += static_cast<double>(t);
    float end;
    for (const float w : WeightsOf(tau, &end)) sum += static_cast<double>(w);
    ASSERT_LE(sum, 1 + kSamples * 0x1p-24);
    ASSERT_GE(end, 0.f);
    ASSERT_NEAR(static_cast<double>(end) / std::exp(-depth), 1, 1e-6 + depth * kSamples * 0x1p-24);
    greatest = std::max(greatest, depth);
  }
  EXPECT_GT(greatest, 30);
}

TEST(Numerics, LightBehindTheStopChangesAColourByNoMoreThanItsShare) {
  static_assert(kEarlyStopTransmittance <= 1e-4f, "80 dB: metrics must not see the stop");
  constexpr int kSamples = 192;
  int stopped_early = 0;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    io::Random random(seed, io::Stream::kInit, 0, 0);
    Floats tau, rgb;
    for (int i = 0; i < kSamples; ++i) tau.push_back(0.3f * random.Uniform());
    for (int i = 0; i < 3 * kSamples; ++i) rgb.push_back(random.Uniform());
    const float background = random.Uniform();
    // With the background behind the stop added; nothing is renormalised.
    const auto shown = [&](std::size_t n) {
      float end, colour[3];
      const Floats weights =
          WeightsOf(Floats(tau.begin(), tau.begin() + static_cast<std::ptrdiff_t>(n)), &end);
      CompositeColour(static_cast<int>(n), weights.data(), rgb.data(), colour);
      return std::array{
          colour[0] + end * background, colour[1] + end * background, colour[2] + end * background};
    };
    const auto full = shown(kSamples);
    for (const float stop : {1e-2f, 1e-3f, 1e-4f, 1e-6f}) {
      float end;
      const Floats transmittance = TransmittancesOf(tau, &end);
      const auto n = static_cast<std::size_t>(
          std::find_if(transmittance.begin(), transmittance.end(), [&](float t) { return t < stop; }) -
          transmittance.begin());
      stopped_early += n < kSamples;
      const auto cut = shown(n);
      for (std::size_t j = 0; j < 3; ++j)
        ASSERT_LE(std::fabs(full[j] - cut[j]), stop * std::max(background, 1 - background) + 1e-6f);
    }
  }
  EXPECT_GT(stopped_early, 1000);
}

TEST(Numerics, NotANumberPassesActivationsQuadratureAndLoss) {
  for (const DensityActivation activation : {DensityActivation::kSoftplus, DensityActivation::kRelu}) {
    EXPECT_TRUE(std::isnan(Density(activation, kNaN)));
    EXPECT_TRUE(std::isnan(DensityGradient(activation, kNaN)));
  }
  EXPECT_TRUE(std::isnan(Sigmoid(kNaN)));
  ForEachBuild([](const Kernels& build) {
    for (const Function function : {build.exp, build.one_minus_exp_neg, build.sigmoid}) {
      Floats x;  // with any payload, which integer tricks on the bits must not turn into an exponent
      for (std::uint32_t i = 0; i < 37; ++i)
        x.push_back(std::bit_cast<float>((i % 2 ? 0xffc00000u : 0x7fc00000u) + 12345u * i));
      function(37, x.data());
      for (const float value : x) ASSERT_TRUE(std::isnan(value));
    }
  });
  const float tau[3] = {0.1f, kNaN, 0.2f}, white[3] = {1, 1, 1}, colour[3] = {0, kNaN, 0};
  float weights[3];
  Opacities(3, tau, weights);
  const float end = WeightsFromOpacities(3, tau, weights);
  EXPECT_TRUE(std::isnan(end));
  EXPECT_TRUE(std::isnan(RandomBackgroundLoss(white, end, {{0, 0, 0}, 1}).loss));
  EXPECT_TRUE(std::isnan(RandomBackgroundLoss(colour, 0.f, {{0, 0, 0}, 1}).loss));
  EXPECT_TRUE(std::isnan(FixedBackgroundLoss(colour, 0.f, {{0, 0, 0}, 1}, white).loss));
}

// Every file has its contraction rule on the command line, kernels alone may fuse, and nothing weakens
// IEEE rules. tests/CMakeLists.txt checks that the headers refuse such flags.
TEST(Numerics, FlagsOfEveryFileKeepIeeeRules) {
  const std::string text = ReadText(std::string(BINARY_DIR) + "/compile_commands.json");
  int files = 0;
  for (std::size_t at = text.find("\"command\""); at != std::string::npos; ++files) {
    const std::size_t end = text.find("\"command\"", at + 1);
    const std::string entry = text.substr(at, end == std::string::npos ? end : end - at);
    at = end;
    EXPECT_NE(entry.find("-ffp-contract=off"), std::string::npos) << entry;
    if (entry.find("-ffp-contract=fast") != std::string::npos) {
      EXPECT_NE(entry.find("nerf/kernels/"), std::string::npos) << entry;
    }
    for (const char* flag : {"-ffast-math", "-Ofast", "-ffinite-math", "-funsafe-math", "-fassociative"})
      EXPECT_EQ(entry.find(flag), std::string::npos) << entry;
  }
  EXPECT_GT(files, 50);
}

}  // namespace
}  // namespace nerf
