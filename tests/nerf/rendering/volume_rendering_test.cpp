// Quadrature and loss of nerf/rendering/volume_rendering.h: hard optical depths, closed forms, derivatives.
#include "nerf/rendering/volume_rendering.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "io/base/random.h"
#include "nerf/kernels/kernels.h"

namespace nerf {
namespace {

// Weights as the training of `hash` computes them.
std::vector<float> Weights(const std::vector<float>& tau, float* end) {
  std::vector<float> weights = tau;
  kernels::ActiveKernels().one_minus_exp_neg(static_cast<int>(tau.size()), weights.data());
  *end = WeightsFromOpacities(static_cast<int>(tau.size()), tau.data(), weights.data());
  return weights;
}

TEST(VolumeRendering, ThinFogKeepsSevenDigits) {
  // tau = 1e-4 over 1024 samples: the naive 1 - exp loses 22 % of this opacity in float.
  float end;
  const std::vector<float> weights = Weights(std::vector<float>(1024, 1e-4f / 1024), &end);
  double opacity = 0;
  for (const float w : weights) opacity += w;
  EXPECT_NEAR(opacity / -std::expm1(-1e-4), 1, 1e-5);
}

TEST(VolumeRendering, OneSpikeTakesAllTheWeight) {
  std::vector<float> tau(64, 0.f);
  tau[20] = 1e10f;
  tau[30] = 1e10f;
  float end;
  const std::vector<float> weights = Weights(tau, &end);
  for (std::size_t i = 0; i < weights.size(); ++i) EXPECT_NEAR(weights[i], i == 20 ? 1.f : 0.f, 1e-5);
  EXPECT_EQ(end, 0.f);
}

TEST(VolumeRendering, EmptyRayShowsExactlyTheBackground) {
  float end;
  const std::vector<float> weights = Weights(std::vector<float>(64, 0.f), &end);
  for (const float w : weights) EXPECT_EQ(w, 0.f);
  EXPECT_EQ(end, 1.f);
}

TEST(VolumeRendering, WeightsAndBackgroundSumToOneWithinRounding) {
  int rays = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed, ++rays) {
    io::Random random(seed, io::Stream::kInit, 0, 0);
    std::vector<float> tau(192);
    const float scale = std::exp(10.f * random.Uniform() - 7.f);
    for (float& t : tau) t = scale * random.Uniform();
    float end;
    double sum = 0;
    for (const float w : Weights(tau, &end)) {
      ASSERT_GE(w, 0.f);
      sum += w;
    }
    ASSERT_NEAR(sum + end, 1, 192 * 0x1p-23);
  }
  EXPECT_EQ(rays, 2000);
}

using Background = std::array<float, 3>;

struct RayCase {
  std::vector<double> log_sigma, delta, logits;
  PixelTarget target;
  std::optional<Background> background;  // none: the loss over random backgrounds
};

RayCase MakeRay(std::uint64_t seed, int n, double depth_scale) {
  io::Random random(seed, io::Stream::kInit, 0, 0);
  RayCase ray;
  for (int i = 0; i < n; ++i) {
    ray.log_sigma.push_back(std::log(depth_scale) + 4 * random.Uniform() - 2);
    ray.delta.push_back(0.02 + 0.05 * random.Uniform());
    for (int j = 0; j < 3; ++j) ray.logits.push_back(4 * random.Uniform() - 2);
  }
  ray.target = {{random.Uniform(), random.Uniform(), random.Uniform()}, random.Uniform()};
  return ray;
}

// The same ray under both losses; the fixed background has unequal channels, 0 among them.
std::array<RayCase, 2> UnderBothLosses(const RayCase& ray) {
  RayCase fixed = ray;
  fixed.background = {1.f, 0.f, 0.3f};
  return {ray, fixed};
}

template <typename Scalar>
struct Gradients {
  Scalar loss;
  std::vector<Scalar> rgb, tau;  // d loss / d colour [n][3], d loss / d optical depth [n]
};

template <typename Scalar>
Gradients<Scalar> Differentiate(const std::vector<Scalar>& tau,
                                const std::vector<Scalar>& rgb,
                                const PixelTarget& target,
                                const std::optional<Background>& background) {
  const int n = static_cast<int>(tau.size());
  std::vector<Scalar> weights(tau.size());
  Opacities(n, tau.data(), weights.data());
  const Scalar end = WeightsFromOpacities(n, tau.data(), weights.data());
  Scalar colour[3];
  CompositeColour(n, weights.data(), rgb.data(), colour);
  const PixelLoss<Scalar> pixel = background ? FixedBackgroundLoss(colour, end, target, background->data())
                                             : RandomBackgroundLoss(colour, end, target);
  Gradients<Scalar> result{pixel.loss, std::vector<Scalar>(rgb.size()), std::vector<Scalar>(tau.size())};
  CompositeGradients(
      n, weights.data(), rgb.data(), end, pixel, Scalar(1), result.rgb.data(), result.tau.data());
  return result;
}

void Inputs(const RayCase& ray, std::vector<double>* tau, std::vector<double>* rgb) {
  tau->clear(), rgb->clear();
  for (std::size_t i = 0; i < ray.delta.size(); ++i)
    tau->push_back(std::exp(ray.log_sigma[i]) * ray.delta[i]);
  for (const double logit : ray.logits) rgb->push_back(1 / (1 + std::exp(-logit)));
}

// The loss as a function of what a network puts out, sigma = exp(log sigma) and rgb = sigmoid(logit).
double LossOf(const RayCase& ray,
              std::vector<double>* logit_gradients,
              std::vector<double>* log_sigma_gradients) {
  std::vector<double> tau, rgb;
  Inputs(ray, &tau, &rgb);
  const Gradients<double> result = Differentiate(tau, rgb, ray.target, ray.background);
  *logit_gradients = result.rgb;
  *log_sigma_gradients = result.tau;
  for (std::size_t i = 0; i < rgb.size(); ++i) (*logit_gradients)[i] *= rgb[i] * (1 - rgb[i]);
  for (std::size_t i = 0; i < tau.size(); ++i) (*log_sigma_gradients)[i] *= tau[i];
  return result.loss;
}

TEST(VolumeRendering, GradientsEqualCentralDifferences) {
  constexpr double kStep = 1e-6;
  int checked = 0;
  for (const double depth_scale : {1e-3, 1.0, 30.0, 1e3}) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      for (RayCase& ray : UnderBothLosses(MakeRay(seed, 12, depth_scale))) {
        std::vector<double> logit_gradients, log_sigma_gradients, ignored_a, ignored_b;
        LossOf(ray, &logit_gradients, &log_sigma_gradients);
        const auto check = [&](double* parameter, double analytic) {
          const double value = *parameter;
          *parameter = value + kStep;
          const double above = LossOf(ray, &ignored_a, &ignored_b);
          *parameter = value - kStep;
          const double below = LossOf(ray, &ignored_a, &ignored_b);
          *parameter = value;
          ASSERT_NEAR(analytic, (above - below) / (2 * kStep), 1e-9 + 1e-6 * std::fabs(analytic));
          ++checked;
        };
        for (std::size_t i = 0; i < ray.log_sigma.size(); ++i)
          check(&ray.log_sigma[i], log_sigma_gradients[i]);
        for (std::size_t i = 0; i < ray.logits.size(); ++i) check(&ray.logits[i], logit_gradients[i]);
      }
    }
  }
  EXPECT_EQ(checked, 2 * 4 * 5 * 12 * 4);
}

template <typename A, typename B>
double RelativeDistance(const std::vector<A>& a, const std::vector<B>& b) {
  double error = 0, norm = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    error += std::pow(static_cast<double>(a[i]) - static_cast<double>(b[i]), 2);
    norm += std::pow(static_cast<double>(b[i]), 2);
  }
  return std::sqrt(error / norm);
}

// A check that cannot see an error of 1e-6 would pass wrong derivatives too.
TEST(VolumeRendering, DifferencesInDoubleResolveARelativeErrorOfOneInAMillion) {
  constexpr double kStep = 1e-5;
  for (RayCase& ray : UnderBothLosses(MakeRay(4, 12, 10.0))) {
    std::vector<double> logit_gradients, analytic, ignored_a, ignored_b, numeric;
    LossOf(ray, &logit_gradients, &analytic);
    for (double& parameter : ray.log_sigma) {
      const double value = parameter;
      const auto at = [&](double offset) {
        parameter = value + offset;
        return LossOf(ray, &ignored_a, &ignored_b);
      };
      numeric.push_back((at(kStep) - at(-kStep)) / (2 * kStep));
      parameter = value;
    }
    EXPECT_LE(RelativeDistance(analytic, numeric), 1e-8);
    for (double& g : analytic) g *= 1 + 1e-6;
    EXPECT_GE(RelativeDistance(analytic, numeric), 5e-7);
  }
}

TEST(VolumeRendering, GradientsInFloatFollowThoseInDouble) {
  for (const double depth_scale : {1e-3, 1.0, 30.0, 1e3}) {
    std::vector<float> all;
    std::vector<double> all_exact;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      for (const RayCase& ray : UnderBothLosses(MakeRay(seed, 192, depth_scale / 16))) {
        std::vector<double> tau, rgb;
        Inputs(ray, &tau, &rgb);
        const std::vector<float> tau_f(tau.begin(), tau.end()), rgb_f(rgb.begin(), rgb.end());
        tau.assign(tau_f.begin(), tau_f.end()), rgb.assign(rgb_f.begin(), rgb_f.end());
        const Gradients<float> g = Differentiate(tau_f, rgb_f, ray.target, ray.background);
        const Gradients<double> exact = Differentiate(tau, rgb, ray.target, ray.background);
        for (const auto* part : {&g.tau, &g.rgb}) all.insert(all.end(), part->begin(), part->end());
        for (const auto* part : {&exact.tau, &exact.rgb})
          all_exact.insert(all_exact.end(), part->begin(), part->end());
      }
    }
    EXPECT_LE(RelativeDistance(all, all_exact), 1e-5) << depth_scale;
    double dot = 0, a = 0, b = 0;
    for (std::size_t i = 0; i < all.size(); ++i)
      dot += all[i] * all_exact[i], a += std::pow(all[i], 2), b += std::pow(all_exact[i], 2);
    EXPECT_GE(dot / std::sqrt(a * b), 1 - 1e-8) << depth_scale;
  }
}

// The derivative of the product form divides by 1 - alpha = 0 here.
TEST(VolumeRendering, GradientAroundAnOpaqueSampleEqualsTheDifferencesInDouble) {
  constexpr double kStep = 1e-6;
  for (const float opaque : {16.f, 88.f, 1e4f, 1e10f}) {
    for (const RayCase& ray : UnderBothLosses(MakeRay(11, 9, 10.0))) {
      std::vector<double> tau, rgb;
      Inputs(ray, &tau, &rgb);
      tau[4] = opaque;
      const std::vector<float> tau_f(tau.begin(), tau.end()), rgb_f(rgb.begin(), rgb.end());
      const Gradients<float> g = Differentiate(tau_f, rgb_f, ray.target, ray.background);
      const auto check = [&](std::vector<double>* values, std::size_t i, float gradient) {
        const double value = (*values)[i];
        const auto loss_at = [&](double x) {
          (*values)[i] = x;
          return Differentiate(tau, rgb, ray.target, ray.background).loss;
        };
        const double difference = (loss_at(value + kStep) - loss_at(value - kStep)) / (2 * kStep);
        (*values)[i] = value;
        EXPECT_NEAR(gradient, difference, 1e-5) << opaque << " " << i;
      };
      for (std::size_t i = 0; i < tau.size(); ++i) check(&tau, i, g.tau[i]);
      for (std::size_t i = 0; i < rgb.size(); ++i) check(&rgb, i, g.rgb[i]);
    }
  }
}

TEST(VolumeRendering, LossIsTheMeanOverRandomBackgrounds) {
  const RayCase ray = MakeRay(7, 10, 3.0);
  std::vector<double> a, b;
  const double loss = LossOf(ray, &a, &b);
  std::vector<double> tau, weights(10);
  for (std::size_t i = 0; i < 10; ++i) tau.push_back(std::exp(ray.log_sigma[i]) * ray.delta[i]);
  Opacities(10, tau.data(), weights.data());
  const double end = WeightsFromOpacities(10, tau.data(), weights.data());
  double colour[3] = {};
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t j = 0; j < 3; ++j) colour[j] += weights[i] / (1 + std::exp(-ray.logits[3 * i + j]));
  }
  double mean = 0;
  constexpr int kDraws = 200000;
  io::Random random(1, io::Stream::kInit, 0, 0);
  for (int d = 0; d < kDraws; ++d) {
    for (int j = 0; j < 3; ++j) {
      const double background = random.Uniform();
      const double error =
          colour[j] + end * background - ray.target.premultiplied[j] - (1 - ray.target.alpha) * background;
      mean += 0.5 * error * error / kDraws;
    }
  }
  EXPECT_NEAR(loss, mean, 2e-3 * mean + 1e-5);
}

TEST(VolumeRendering, LossOnAFixedBackgroundIsTheMeanSquaredErrorOfTheComposite) {
  for (const RayCase& ray : UnderBothLosses(MakeRay(7, 10, 3.0))) {
    if (!ray.background) continue;
    std::vector<double> a, b, tau, rgb, weights(10);
    Inputs(ray, &tau, &rgb);
    Opacities(10, tau.data(), weights.data());
    const double end = WeightsFromOpacities(10, tau.data(), weights.data());
    double expected = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      double shown = end * (*ray.background)[j];
      for (std::size_t i = 0; i < 10; ++i) shown += weights[i] * rgb[3 * i + j];
      const double truth =
          ray.target.premultiplied[j] + (1.0 - ray.target.alpha) * static_cast<double>((*ray.background)[j]);
      expected += (shown - truth) * (shown - truth) / 3;
    }
    EXPECT_NEAR(LossOf(ray, &a, &b), expected, 1e-12);
  }
}

TEST(VolumeRendering, OpaqueAndTransparentExtremesHaveFiniteGradients) {
  for (const double depth_scale : {1e-30, 1e30}) {
    std::vector<double> logit_gradients, log_sigma_gradients;
    for (const RayCase& ray : UnderBothLosses(MakeRay(3, 8, depth_scale))) {
      EXPECT_TRUE(std::isfinite(LossOf(ray, &logit_gradients, &log_sigma_gradients)));
      for (const double g : logit_gradients) EXPECT_TRUE(std::isfinite(g));
      for (const double g : log_sigma_gradients) EXPECT_TRUE(std::isfinite(g));
    }
  }
}

// Quadrature order on a smooth medium: colour 0.5 + 0.5 sin 3t seen through a Gaussian blob, against a fine
// reference.
TEST(VolumeRendering, MidpointRuleIsSecondOrderOnASmoothMedium) {
  const auto render = [](int n) {
    std::vector<double> tau(static_cast<std::size_t>(n)), weights(tau.size());
    const double delta = 4.0 / n;
    for (int i = 0; i < n; ++i) {
      const double t = 2 + (i + 0.5) * delta;
      tau[static_cast<std::size_t>(i)] = 3 * std::exp(-(t - 4.1) * (t - 4.1) / 0.5) * delta;
    }
    Opacities(n, tau.data(), weights.data());
    WeightsFromOpacities(n, tau.data(), weights.data());
    double colour = 0;
    for (int i = 0; i < n; ++i) {
      const double t = 2 + (i + 0.5) * delta;
      colour += weights[static_cast<std::size_t>(i)] * (0.5 + 0.5 * std::sin(3 * t));
    }
    return colour;
  };
  const double exact = render(1 << 16);
  const double coarse = std::fabs(render(64) - exact), fine = std::fabs(render(256) - exact);
  EXPECT_GE(std::log(coarse / fine) / std::log(4), 1.9);
  EXPECT_LT(fine, 2e-4);
}

}  // namespace
}  // namespace nerf
