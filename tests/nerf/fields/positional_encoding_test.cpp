// nerf/fields/positional_encoding.h against double: every frequency, and arguments of any size.
#include "nerf/fields/positional_encoding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "io/base/random.h"

namespace nerf {
namespace {

TEST(PositionalEncoding, ValuesComeInTheDocumentedOrder) {
  const double p[3] = {0.5, -0.25, 0.125}, pi = std::numbers::pi;
  for (const bool identity : {false, true}) {
    for (const bool times_pi : {false, true}) {
      const EncodingOptions options{.frequencies = 3, .identity = identity, .times_pi = times_pi};
      ASSERT_EQ(EncodedSize(options), identity ? 21 : 18);
      std::vector<double> code(21, 7), expected;
      PositionalEncoding(options, p, code.data());
      if (identity) expected.assign(p, p + 3);
      for (int k = 0; k < 3; ++k) {
        const double f = (times_pi ? pi : 1.0) * std::ldexp(1.0, k);
        for (const double x : p) expected.push_back(std::sin(f * x));
        for (const double x : p) expected.push_back(std::cos(f * x));
      }
      for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(code[i], expected[i], 1e-15) << i;
      for (std::size_t i = expected.size(); i < code.size(); ++i)
        EXPECT_EQ(code[i], 7) << "written past the end";
    }
  }
}

TEST(PositionalEncoding, WithoutFrequenciesItIsThePositionItself) {
  const float p[3] = {0.5f, -3.f, 100.f};
  const EncodingOptions options{.frequencies = 0};
  ASSERT_EQ(EncodedSize(options), 3);
  float code[3];
  PositionalEncoding(options, p, code);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(code[i], p[i]);
}

// Worst error of sin and cos at each frequency, over points of [-1, 1].
std::vector<double> WorstErrors(int frequencies, bool times_pi) {
  const EncodingOptions options{.frequencies = frequencies, .identity = false, .times_pi = times_pi};
  std::vector<double> worst(static_cast<std::size_t>(frequencies));
  std::vector<float> code(static_cast<std::size_t>(EncodedSize(options)));
  for (std::uint64_t i = 0; i < 33334; ++i) {  // 1e5 values, as they come in threes
    io::Random random(1, io::Stream::kInit, 0, 3 * i);
    float p[3];
    for (float& x : p) x = 2 * random.Uniform() - 1;
    PositionalEncoding(options, p, code.data());
    for (std::size_t k = 0; k < worst.size(); ++k) {
      for (std::size_t j = 0; j < 3; ++j) {
        const double x = std::ldexp(static_cast<double>(p[j]), static_cast<int>(k));
        const double angle = times_pi ? std::numbers::pi * (x - 2 * std::nearbyint(x / 2)) : x;
        worst[k] = std::max({worst[k],
                             std::fabs(static_cast<double>(code[6 * k + j]) - std::sin(angle)),
                             std::fabs(static_cast<double>(code[6 * k + 3 + j]) - std::cos(angle))});
      }
    }
  }
  return worst;
}

TEST(PositionalEncoding, ErrorIsThatOfOneSineAtEveryFrequency) {
  for (const bool times_pi : {false, true}) {
    for (const double error : WorstErrors(20, times_pi)) {
      EXPECT_LE(error, 1e-6);
      EXPECT_GT(error, 1e-9) << "the sweep did not run";
    }
  }
}

// Why the argument is reduced before it is multiplied by pi.
TEST(PositionalEncoding, TheDirectProductWouldLoseThreeDigitsAtTheTenthFrequency) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 100000; ++i) {
    const float x = 2 * io::Random(1, io::Stream::kInit, 0, i).Uniform() - 1;
    const double exact = 512 * static_cast<double>(x);
    const float direct = std::sin(x * (512 * std::numbers::pi_v<float>));
    worst = std::max(worst,
                     std::fabs(static_cast<double>(direct) -
                               std::sin(std::numbers::pi * (exact - 2 * std::nearbyint(exact / 2)))));
  }
  EXPECT_GT(worst, 5e-5);
  EXPECT_LE(worst, 1.5e-4);
}

double Ulps(float value, double exact) {
  const int exponent = exact == 0 ? -126 : std::max(std::ilogb(exact), -126);
  return std::fabs(static_cast<double>(value) - exact) / std::ldexp(1.0, exponent - 23);
}

TEST(PositionalEncoding, SinesHoldThreeUlpForArgumentsOfAnySize) {
  const EncodingOptions options{.frequencies = 1, .identity = false, .times_pi = false};
  int checked = 0;
  for (const float range : {1e-30f, 1.f, 39000.f, 1e8f, 1e30f}) {
    for (std::uint64_t i = 0; i < 20000; ++i, ++checked) {
      const float x = range * (2 * io::Random(2, io::Stream::kInit, 0, i).Uniform() - 1), p[3] = {x, -x, x};
      float code[6];
      PositionalEncoding(options, p, code);
      ASSERT_LE(Ulps(code[0], std::sin(static_cast<double>(x))), 3) << x;
      ASSERT_LE(Ulps(code[3], std::cos(static_cast<double>(x))), 3) << x;
      ASSERT_EQ(code[1], -code[0]);
      ASSERT_EQ(code[4], code[3]);
    }
  }
  EXPECT_EQ(checked, 100000);
}

TEST(PositionalEncoding, ZeroGivesZeroAndWhatIsNotFiniteShows) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  for (const bool times_pi : {false, true}) {
    const EncodingOptions options{.frequencies = 2, .identity = false, .times_pi = times_pi};
    const float zeros[3] = {0.f, -0.f, 0.f}, bad[3] = {inf, -inf, nan};
    float code[12];
    PositionalEncoding(options, zeros, code);
    for (const int k : {0, 6}) {
      for (int j = 0; j < 3; ++j) {
        EXPECT_EQ(code[k + j], 0.f);
        EXPECT_EQ(code[k + 3 + j], 1.f);
        EXPECT_EQ(std::signbit(code[k + j]), j == 1 && !times_pi);  // the reduction drops the sign of zero
      }
    }
    PositionalEncoding(options, bad, code);
    for (const float value : code) EXPECT_TRUE(std::isnan(value));
  }
}

}  // namespace
}  // namespace nerf
