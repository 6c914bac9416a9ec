// Rules of nerf/sampling/quadrature.h: intervals, importance sampling, and the error of each rule against the
// number of samples.
#include "nerf/sampling/quadrature.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>

#include "io/base/error.h"
#include "nerf/rendering/volume_rendering.h"

namespace nerf {
namespace {

using Doubles = std::vector<double>;

TEST(Intervals, MiddlesOfEqualBinsStandForTheirBins) {
  Doubles t, delta;
  StratifiedDistances(2.0, 6.0, 8, nullptr, &t);
  IntervalLengths(2.0, 6.0, false, t, &delta);
  ASSERT_EQ(t.size(), 8u);
  for (std::size_t i = 0; i < t.size(); ++i) {
    EXPECT_DOUBLE_EQ(t[i], 2.25 + 0.5 * static_cast<double>(i));
    EXPECT_DOUBLE_EQ(delta[i], 0.5);
  }
}

TEST(Intervals, RandomSamplesStayInTheirBinsAndFillThemEvenly) {
  double mean = 0;
  constexpr int kRays = 2000, kBins = 16;
  for (std::uint64_t ray = 0; ray < kRays; ++ray) {
    io::Random random(1, io::Stream::kRay, 0, 1000 * ray);
    std::vector<float> t;
    StratifiedDistances(2.f, 6.f, kBins, &random, &t);
    ASSERT_EQ(t.size(), std::size_t{kBins});
    for (std::size_t i = 0; i < t.size(); ++i) {
      const double in_bin = (t[i] - 2.0) / 0.25 - static_cast<double>(i);
      ASSERT_GE(in_bin, 0);
      ASSERT_LE(in_bin, 1);
      mean += in_bin / (kRays * kBins);
    }
  }
  EXPECT_NEAR(mean, 0.5, 5 * std::sqrt(1.0 / 12 / (kRays * kBins)));
}

// Opacity stays that of the interval [near, far], whatever density is left at its end.
TEST(Intervals, ClosedOnesEndAtFarAndOnlyTheExplicitOpenEndTurnsATailOpaque) {
  EXPECT_FALSE(QuadratureOptions().open_end);
  constexpr double kFog = 1e-7;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    io::Random random(seed, io::Stream::kRay, 0, 0);
    Doubles t, closed, open;
    StratifiedDistances(2.0, 6.0, 64, &random, &t);
    IntervalLengths(2.0, 6.0, false, t, &closed);
    IntervalLengths(2.0, 6.0, true, t, &open);
    double closed_sum = 0, open_sum = 0;
    for (std::size_t i = 0; i < t.size(); ++i) closed_sum += closed[i], open_sum += open[i];
    EXPECT_NEAR(closed_sum, 4, 1e-12);
    EXPECT_NEAR(-std::expm1(-kFog * closed_sum) / -std::expm1(-kFog * 4), 1, 1e-9);
    EXPECT_EQ(open.back(), kOpenEnd);
    EXPECT_EQ(-std::expm1(-kFog * open_sum), 1);
  }
}

TEST(Intervals, DegenerateRangesGiveNoSamples) {
  constexpr float kInf = std::numeric_limits<float>::infinity(),
                  kNaN = std::numeric_limits<float>::quiet_NaN();
  const float ranges[][2] = {{2, 2}, {6, 2}, {-1, -2}, {kNaN, 2}, {2, kNaN}, {kInf, kInf}, {2, -kInf}};
  for (const auto& range : ranges) {
    std::vector<float> t = {7.f}, delta = {7.f};
    StratifiedDistances(range[0], range[1], 64, nullptr, &t);
    EXPECT_TRUE(t.empty()) << range[0] << " " << range[1];
    IntervalLengths(range[0], range[1], false, t, &delta);
    EXPECT_TRUE(delta.empty());
    AddImportanceSamples(range[0], range[1], {}, 16, nullptr, &t);
    EXPECT_TRUE(t.empty());
  }
  std::vector<float> t;
  EXPECT_THROW(StratifiedDistances(2.f, kInf, 64, nullptr, &t), io::Error);
  EXPECT_THROW(StratifiedDistances(-kInf, 2.f, 64, nullptr, &t), io::Error);
}

TEST(Intervals, LengthsAreNeverNegative) {
  const float ranges[][2] = {{2, 6}, {-1, 3}, {0, 1e-30f}, {2, std::nextafter(2.f, 3.f)}, {1e6f, 1e6f + 1}};
  for (const auto& [near, far] : ranges) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      for (const int n : {1, 2, 64, 1024}) {
        io::Random random(seed, io::Stream::kRay, 0, 0);
        std::vector<float> t, delta;
        StratifiedDistances(near, far, n, seed ? &random : nullptr, &t);
        AddImportanceSamples(near, far, std::vector<float>(t.size(), 1.f), 64, &random, &t);
        for (const bool open_end : {false, true}) {
          IntervalLengths(near, far, open_end, t, &delta);
          for (const float d : delta) ASSERT_GE(d, 0.f) << near << " " << far << " " << n;
        }
      }
    }
  }
}

// The distances that AddImportanceSamples has added.
template <typename Scalar>
std::vector<Scalar> Added(const std::vector<Scalar>& weights, int n, io::Random* random) {
  std::vector<Scalar> t, all, added;
  StratifiedDistances(Scalar(2), Scalar(6), static_cast<int>(weights.size()), nullptr, &t);
  all = t;
  AddImportanceSamples(Scalar(2), Scalar(6), weights, n, random, &all);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end()));
  std::set_difference(all.begin(), all.end(), t.begin(), t.end(), std::back_inserter(added));
  return added;
}

TEST(ImportanceSamples, GoWhereTheWeightIs) {
  for (const float weight : {1.f, 1e-38f, 1e-45f, 3e38f}) {
    for (const std::size_t bin : {0u, 1u, 7u}) {
      std::vector<float> weights(8);
      weights[bin] = weight;
      io::Random random(2, io::Stream::kRay, 0, 0);
      for (io::Random* r : {static_cast<io::Random*>(nullptr), &random}) {
        const std::vector<float> added = Added(weights, 101, r);
        EXPECT_GE(added.size(), 100u);  // the middle one may coincide with a given distance
        for (const float t : added) {
          EXPECT_GE(t, 2 + 0.5f * static_cast<float>(bin)) << weight << " " << bin;
          EXPECT_LE(t, 2.5f + 0.5f * static_cast<float>(bin)) << weight << " " << bin;
        }
      }
    }
  }
}

// A floor below all weights, as in the original code, would send samples into the empty intervals.
TEST(ImportanceSamples, IntervalsWithoutWeightGetNone) {
  const std::vector<float> weights = {0, 0.5f, 0, 0, 1e-6f, 0, 0, 0};
  io::Random random(3, io::Stream::kRay, 0, 0);
  for (const float t : Added(weights, 10000, &random))
    EXPECT_TRUE((t >= 2.5f && t <= 3.f) || (t >= 4.f && t <= 4.5f)) << t;
}

TEST(ImportanceSamples, SpreadEvenlyWhereNoWeightSaysOtherwise) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> cases[] = {{0, 0, 0, 0}, {nan, 1, 1, 1}, {0, 0, inf, 0}, {-1, -1, -1, -1}};
  for (const std::vector<float>& weights : cases) {
    const std::vector<float> added = Added(weights, 8, nullptr);
    ASSERT_EQ(added.size(), 8u);
    for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(added[i], 2.25 + 0.5 * static_cast<double>(i), 1e-6);
  }
}

TEST(ImportanceSamples, FollowTheDensityOfTheWeights) {
  const std::vector<float> weights = {0.1f, 1, 0, 3, 1e-3f, 0.5f, 2, 0.05f};
  double total = 0, chi_square = 0;
  for (const float w : weights) total += static_cast<double>(w);
  constexpr int kDraws = 100000;
  std::array<int, 32> counts = {};  // quarters of the intervals: the density within one is constant
  for (std::uint64_t i = 0; i < kDraws; ++i) {
    io::Random random(4, io::Stream::kRay, 0, i);
    for (const float t : Added(weights, 1, &random)) ++counts[static_cast<std::size_t>((t - 2.f) * 8.f)];
  }
  int freedom = -1;
  for (std::size_t q = 0; q < counts.size(); ++q) {
    const double expected = kDraws * static_cast<double>(weights[q / 4]) / total / 4;
    if (expected == 0) {
      EXPECT_EQ(counts[q], 0);
      continue;
    }
    chi_square += (counts[q] - expected) * (counts[q] - expected) / expected;
    ++freedom;
  }
  EXPECT_EQ(freedom, 27);
  EXPECT_LT(chi_square, 55.5) << "p < 1e-3";
}

// With n stratified quantiles the mean is that of the density to half a quantile.
TEST(ImportanceSamples, MeanIsUnbiased) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    io::Random random(seed, io::Stream::kInit, 0, 0);
    Doubles weights;
    double total = 0, exact = 0, mean = 0;
    for (int i = 0; i < 16; ++i) {
      weights.push_back(random.Uniform() < 0.3f ? 0.0 : std::pow(random.Uniform(), 4));
      total += weights.back();
      exact += weights.back() * (2.125 + 0.25 * i);
    }
    constexpr int kCount = 1000;
    Doubles t, all;
    StratifiedDistances(2.0, 6.0, 16, nullptr, &t);
    all = t;
    AddImportanceSamples(2.0, 6.0, weights, kCount, nullptr, &all);
    for (const double x : all) mean += x / kCount;
    for (const double x : t) mean -= x / kCount;
    EXPECT_NEAR(mean, exact / total, 0.5 / kCount * 4);
  }
}

// ---- error against the number of samples

using Density = std::function<double(double)>;
constexpr double kNear = 2, kFar = 6, kCentre = 4;
constexpr std::array<int, 4> kCounts = {16, 64, 256, 1024};

struct TestScene {
  const char* name;
  std::function<Density(double)> density;  // of a scene around the given centre
};

Density Blob(double peak, double width, double centre) {
  return [=](double t) { return peak * std::exp(-(t - centre) * (t - centre) / (width * width)); };
}
Density Slab(double sigma, double centre) {
  return [=](double t) { return std::fabs(t - centre) < 0.3 ? sigma : 0.0; };
}

// Colour 0.5 + 0.5 sin 3t seen through the density, before black.
double Render(const Density& density, int n, io::Random* random, bool open_end) {
  Doubles t, delta;
  StratifiedDistances(kNear, kFar, n, random, &t);
  IntervalLengths(kNear, kFar, open_end, t, &delta);
  Doubles tau, weights(t.size()), rgb;
  for (std::size_t i = 0; i < t.size(); ++i) {
    tau.push_back(density(t[i]) * delta[i]);
    rgb.insert(rgb.end(), 3, 0.5 + 0.5 * std::sin(3 * t[i]));
  }
  Opacities(n, tau.data(), weights.data());
  WeightsFromOpacities(n, tau.data(), weights.data());
  double colour[3];
  CompositeColour(n, weights.data(), rgb.data(), colour);
  return colour[0];
}

enum class Rule { kMidpoint, kRandomClosed, kClassic };

// Root of the mean squared error over 64 scenes whose centres cover kCentre +- 0.05 as a golden-ratio
// sequence, for each of kCounts.
std::array<double, 4> Errors(const TestScene& scene, Rule rule) {
  constexpr int kScenes = 64, kReference = 20000;
  std::array<double, 4> squared = {};
  for (int s = 0; s < kScenes; ++s) {
    const double phase = std::fmod(s * 0.6180339887498949, 1.0);
    const Density density = scene.density(kCentre + 0.05 * (2 * phase - 1));
    const double exact = Render(density, kReference, nullptr, false);
    for (std::size_t i = 0; i < kCounts.size(); ++i) {
      io::Random random(1, io::Stream::kRay, static_cast<std::uint64_t>(s), 10000 * i);
      const double colour =
          Render(density, kCounts[i], rule == Rule::kMidpoint ? nullptr : &random, rule == Rule::kClassic);
      squared[i] += (colour - exact) * (colour - exact) / kScenes;
    }
  }
  for (double& value : squared) value = std::sqrt(value);
  return squared;
}

const TestScene kScenes[] = {{"smooth blob", [](double c) { return Blob(3, 0.5, c); }},
                             {"thin shell", [](double c) { return Blob(40, 0.05, c); }},
                             {"hard slab 50", [](double c) { return Slab(50, c); }},
                             {"hard slab 1", [](double c) { return Slab(1, c); }}};

void Print(const char* scene, const char* rule, const std::array<double, 4>& errors) {
  std::printf("%-13s %-14s", scene, rule);
  for (const double error : errors) std::printf(" %8.1e", error);
  std::printf("\n");
}

// Order of convergence from n to 16 n.
double Order(double coarse, double fine) { return std::log(coarse / fine) / std::log(16); }

TEST(Quadrature, MidpointErrorsAreThoseOfTheTable) {
  constexpr double kTable[][4] = {{3.0e-3, 1.8e-4, 1.1e-5, 7.2e-7},
                                  {1.4e-1, 5.4e-3, 3.0e-4, 1.8e-5},
                                  {8.6e-2, 7.8e-3, 1.4e-3, 3.5e-4},
                                  {2.0e-2, 7.1e-3, 1.6e-3, 3.9e-4}};
  for (std::size_t s = 0; s < 4; ++s) {
    const std::array<double, 4> errors = Errors(kScenes[s], Rule::kMidpoint);
    Print(kScenes[s].name, "midpoint", errors);
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_NEAR(errors[i] / kTable[s][i], 1, 0.1) << kScenes[s].name << " " << kCounts[i];
    EXPECT_GE(Order(errors[1], errors[3]), s < 2 ? 1.9 : 0.9) << kScenes[s].name;
  }
}

// The density left at far, 3e-7, is opaque over 1e10 units and paints the remaining 7 % of the light.
TEST(Quadrature, OpenEndStallsOnASmoothBlobWhereClosedIntervalsConverge) {
  const std::array<double, 4> classic = Errors(kScenes[0], Rule::kClassic);
  const std::array<double, 4> random = Errors(kScenes[0], Rule::kRandomClosed);
  Print(kScenes[0].name, "classic", classic);
  Print(kScenes[0].name, "random closed", random);
  EXPECT_NEAR(classic[1] / 7.3e-3, 1, 0.1);
  EXPECT_NEAR(classic[2] / 8.2e-3, 1, 0.1);
  EXPECT_NEAR(classic[3] / 8.6e-3, 1, 0.1);
  EXPECT_LT(random[3], 0.01 * classic[3]);
  EXPECT_GE(Order(random[1], random[3]), 1.8);
}

}  // namespace
}  // namespace nerf
