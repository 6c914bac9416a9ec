// Quadrature and loss of nerf/volume_rendering.h: hard optical depths, closed forms, derivatives.
#include "nerf/volume_rendering.h"

#include <gtest/gtest.h>

#include <vector>

#include "nerf/kernels/kernels.h"
#include "nerf/random.h"

namespace nerf {
namespace {

// Weights as training computes them: transmittance before the sample times opacity.
std::vector<float> Weights(const std::vector<float>& tau, float* end) {
  std::vector<float> alpha = tau, transmittance(tau.size());
  *end = Transmittance(static_cast<int>(tau.size()), tau.data(), transmittance.data());
  kernels::ActiveKernels().one_minus_exp_neg(static_cast<int>(alpha.size()), alpha.data());
  for (std::size_t i = 0; i < alpha.size(); ++i) alpha[i] *= transmittance[i];
  return alpha;
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
    Random random(seed, Stream::kInit, 0, 0);
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

struct RayCase {
  std::vector<double> log_sigma, delta, logits;
  PixelTarget target;
};

RayCase MakeRay(std::uint64_t seed, int n, double depth_scale) {
  Random random(seed, Stream::kInit, 0, 0);
  RayCase ray;
  for (int i = 0; i < n; ++i) {
    ray.log_sigma.push_back(std::log(depth_scale) + 4 * random.Uniform() - 2);
    ray.delta.push_back(0.02 + 0.05 * random.Uniform());
    for (int j = 0; j < 3; ++j) ray.logits.push_back(4 * random.Uniform() - 2);
  }
  ray.target = {{random.Uniform(), random.Uniform(), random.Uniform()}, random.Uniform()};
  return ray;
}

double LossOf(const RayCase& ray,
              std::vector<double>* logit_gradients,
              std::vector<double>* log_sigma_gradients) {
  const int n = static_cast<int>(ray.delta.size());
  std::vector<double> tau, weights(ray.delta.size()), rgb;
  for (std::size_t i = 0; i < ray.delta.size(); ++i) tau.push_back(std::exp(ray.log_sigma[i]) * ray.delta[i]);
  for (const double logit : ray.logits) rgb.push_back(1 / (1 + std::exp(-logit)));
  const double end = Transmittance(n, tau.data(), weights.data());
  for (std::size_t i = 0; i < tau.size(); ++i) weights[i] *= -std::expm1(-tau[i]);
  logit_gradients->resize(ray.logits.size());
  log_sigma_gradients->resize(tau.size());
  double squared_error;
  return CompositeLoss(n,
                       tau.data(),
                       weights.data(),
                       rgb.data(),
                       end,
                       ray.target,
                       1.0,
                       logit_gradients->data(),
                       log_sigma_gradients->data(),
                       &squared_error);
}

TEST(VolumeRendering, GradientsEqualCentralDifferences) {
  constexpr double kStep = 1e-6;
  int checked = 0;
  for (const double depth_scale : {1e-3, 1.0, 30.0, 1e3}) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      RayCase ray = MakeRay(seed, 12, depth_scale);
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
      for (std::size_t i = 0; i < ray.log_sigma.size(); ++i) check(&ray.log_sigma[i], log_sigma_gradients[i]);
      for (std::size_t i = 0; i < ray.logits.size(); ++i) check(&ray.logits[i], logit_gradients[i]);
    }
  }
  EXPECT_EQ(checked, 4 * 5 * 12 * 4);
}

TEST(VolumeRendering, LossIsTheMeanOverRandomBackgrounds) {
  const RayCase ray = MakeRay(7, 10, 3.0);
  std::vector<double> a, b;
  const double loss = LossOf(ray, &a, &b);
  std::vector<double> tau, weights(10);
  for (std::size_t i = 0; i < 10; ++i) tau.push_back(std::exp(ray.log_sigma[i]) * ray.delta[i]);
  const double end = Transmittance(10, tau.data(), weights.data());
  double colour[3] = {};
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      colour[j] += weights[i] * -std::expm1(-tau[i]) / (1 + std::exp(-ray.logits[3 * i + j]));
  }
  double mean = 0;
  constexpr int kDraws = 200000;
  Random random(1, Stream::kInit, 0, 0);
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

TEST(VolumeRendering, OpaqueAndTransparentExtremesHaveFiniteGradients) {
  for (const double depth_scale : {1e-30, 1e30}) {
    std::vector<double> logit_gradients, log_sigma_gradients;
    const double loss = LossOf(MakeRay(3, 8, depth_scale), &logit_gradients, &log_sigma_gradients);
    EXPECT_TRUE(std::isfinite(loss));
    for (const double g : logit_gradients) EXPECT_TRUE(std::isfinite(g));
    for (const double g : log_sigma_gradients) EXPECT_TRUE(std::isfinite(g));
  }
}

// Quadrature order on a smooth medium: colour 0.5 + 0.5 sin 3t seen through a Gaussian blob, against a fine
// reference.
TEST(VolumeRendering, MidpointRuleIsSecondOrderOnASmoothMedium) {
  const auto render = [](int n) {
    std::vector<double> tau(static_cast<std::size_t>(n)), transmittance(tau.size());
    const double delta = 4.0 / n;
    for (int i = 0; i < n; ++i) {
      const double t = 2 + (i + 0.5) * delta;
      tau[static_cast<std::size_t>(i)] = 3 * std::exp(-(t - 4.1) * (t - 4.1) / 0.5) * delta;
    }
    Transmittance(n, tau.data(), transmittance.data());
    double colour = 0;
    for (int i = 0; i < n; ++i) {
      const double t = 2 + (i + 0.5) * delta;
      colour += transmittance[static_cast<std::size_t>(i)] * -std::expm1(-tau[static_cast<std::size_t>(i)]) *
                (0.5 + 0.5 * std::sin(3 * t));
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
