// The distortion loss against its definition.
#include "nerf/rendering/distortion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "io/base/random.h"

namespace nerf {
namespace {

struct Weighted {
  std::vector<double> w, s, d;
};

// n samples from distance `near` on, the last at most a thousand times as far.
Weighted RandomRay(std::size_t n, std::uint64_t seed, double near) {
  io::Random random(seed, io::Stream::kRay, 0, 0);
  Weighted ray;
  double t = near;
  for (std::size_t i = 0; i < n; ++i) {
    const double delta = t * 0.05 * random.Uniform();
    ray.w.push_back(random.Uniform() / static_cast<double>(n));
    ray.s.push_back(std::log(t + delta / 2));
    ray.d.push_back(delta / t);
    t += delta * (1 + random.Below(4));
  }
  return ray;
}

double ByDefinition(const Weighted& ray) {
  double loss = 0;
  for (std::size_t i = 0; i < ray.w.size(); ++i) {
    for (std::size_t j = 0; j < ray.w.size(); ++j)
      loss += ray.w[i] * ray.w[j] * std::fabs(ray.s[i] - ray.s[j]);
    loss += ray.w[i] * ray.w[i] * ray.d[i] / 3;
  }
  return loss;
}

template <typename Scalar>
double Ours(const Weighted& ray, std::vector<Scalar>* gradients) {
  const std::vector<Scalar> w(ray.w.begin(), ray.w.end()), s(ray.s.begin(), ray.s.end()),
      d(ray.d.begin(), ray.d.end());
  gradients->resize(w.size());
  return double{Distortion(static_cast<int>(w.size()), w.data(), s.data(), d.data(), gradients->data())};
}

TEST(Distortion, EqualsItsDefinitionAndCentralDifferences) {
  constexpr double kStep = 1e-6;
  for (const std::size_t n : {0u, 1u, 2u, 7u, 200u}) {
    for (const double near : {1e-3, 1.0, 1e3}) {
      const Weighted ray = RandomRay(n, n, near);
      const double want = ByDefinition(ray);
      std::vector<double> gradients;
      EXPECT_NEAR(Ours(ray, &gradients), want, 1e-12 * (1 + want));
      for (std::size_t i = 0; i < n; i += 1 + n / 10) {
        Weighted less = ray, more = ray;
        less.w[i] -= kStep, more.w[i] += kStep;
        EXPECT_NEAR(gradients[i], (ByDefinition(more) - ByDefinition(less)) / (2 * kStep), 1e-8) << i;
      }
      std::vector<float> rounded;
      // Places are rounded to half an ulp; they are below 16, the weights' sum is below 1.
      EXPECT_NEAR(Ours(ray, &rounded), want, 1e-5 * want + 5e-7);
      for (std::size_t i = 0; i < n; ++i) ASSERT_NEAR(rounded[i], gradients[i], 1e-5 * gradients[i] + 5e-6);
    }
  }
}

TEST(Distortion, IsLeastForLightFromOnePlace) {
  const std::vector<double> s = {0, 1, 2, 3}, d = {0.1, 0.1, 0.1, 0.1};
  std::vector<double> gradients;
  const double one = Ours<double>({{0, 1, 0, 0}, s, d}, &gradients),
               near = Ours<double>({{0, 0.5, 0.5, 0}, s, d}, &gradients),
               apart = Ours<double>({{0.5, 0, 0, 0.5}, s, d}, &gradients);
  EXPECT_NEAR(one, 0.1 / 3, 1e-15);
  EXPECT_LT(one, near);
  EXPECT_LT(near, apart);
}

}  // namespace
}  // namespace nerf
