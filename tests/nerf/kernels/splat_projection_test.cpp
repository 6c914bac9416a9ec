// Projection of every build against its plain reference, and its gradient against differences of that.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "io/base/random.h"
#include "nerf/kernels/kernels.h"
#include "nerf/kernels/splat_projection_reference.h"

namespace nerf {
namespace {

using kernels::BlendedSplat;
using kernels::BlendedSplatGradient;
using kernels::Kernels;
using kernels::reference::ProjectedSplat;

constexpr int kColourValues = 3 * kernels::kSplatHarmonics;
constexpr std::array<int, 5> kWidths = {3, 3, 4, 1, kColourValues};

// Looks along z, turned by 0.3 about x.
kernels::SplatCamera SomeCamera() {
  const float c = std::cos(0.3f), s = std::sin(0.3f);
  return {.rotation = {1, 0, 0, 0, c, -s, 0, s, c},
          .centre = {0.1f, -0.2f, 0.3f},
          .fl_x = 70,
          .fl_y = 80,
          .cx = 31,
          .cy = 22,
          .width = 64,
          .height = 48,
          .lowest_slope = {-0.5f, -0.4f},
          .highest_slope = {0.55f, 0.45f},
          .low_pass = 0.3f,
          .nearest = 0.2f};
}

// The values of splats as the kernels have them: places, log scales, rotations, opacities, colours.
using Values = std::array<std::vector<float>, 5>;

// Before, beside and behind the camera.
Values SomeSplats(int n) {
  Values values;
  const std::array<float, 5> least = {-3, -4, -1, -7, -1}, most = {3, 0, 1, 5, 1};
  for (std::size_t kind = 0; kind < values.size(); ++kind) {
    for (int i = 0; i < n * kWidths[kind]; ++i) {
      io::Random random(5, io::Stream::kSplat, kind, static_cast<std::uint64_t>(i));
      values[kind].push_back(least[kind] + (most[kind] - least[kind]) * random.Uniform());
    }
  }
  return values;
}

kernels::SplatArrays<const float> ArraysOf(const Values& values) {
  return {values[0].data(), values[1].data(), values[2].data(), values[3].data(), values[4].data()};
}

using WideValues = std::array<std::vector<double>, 5>;

WideValues Row(const Values& values, std::size_t splat) {
  WideValues row;
  for (std::size_t kind = 0; kind < values.size(); ++kind) {
    const auto width = static_cast<std::size_t>(kWidths[kind]);
    const float* begin = &values[kind][splat * width];
    row[kind].assign(begin, begin + width);
  }
  return row;
}

ProjectedSplat Reference(const WideValues& row) {
  return kernels::reference::ProjectSplat(
      SomeCamera(), {row[0].data(), row[1].data(), row[2].data(), row[3].data(), row[4].data()});
}

bool ReachesPicture(const ProjectedSplat& splat) {
  const auto& b = splat.blended;
  const kernels::SplatCamera camera = SomeCamera();
  return splat.depth > static_cast<double>(camera.nearest) &&
         b.opacity > static_cast<double>(kernels::kMinSplatAlpha) && b.x + b.reach_x > 0 &&
         b.x - b.reach_x < static_cast<double>(camera.width) && b.y + b.reach_y > 0 &&
         b.y - b.reach_y < static_cast<double>(camera.height);
}

class SplatProjection : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    build_ = kernels::FindKernels(GetParam());
    if (!build_) GTEST_SKIP() << "this CPU lacks it";
  }
  const Kernels* build_ = nullptr;
};

TEST_P(SplatProjection, IsThatOfTheReference) {
  constexpr int kFirst = 3, kNumber = 1997;  // no whole vectors
  const Values values = SomeSplats(kFirst + kNumber);
  std::vector<BlendedSplat> blended(kNumber);
  std::vector<float> depths(kNumber, -1);
  build_->project_splats(SomeCamera(), ArraysOf(values), kFirst, kNumber, blended.data(), depths.data());
  int n_beside = 0, n_seen = 0, n_in_vain = 0;
  for (std::size_t i = 0; i < kNumber; ++i) {
    const ProjectedSplat want = Reference(Row(values, kFirst + i));
    const bool reaches = ReachesPicture(want);
    n_beside += !reaches;
    if (depths[i] == 0) {
      EXPECT_FALSE(reaches) << i;
      continue;
    }
    ++n_seen, n_in_vain += !reaches;
    const BlendedSplat& got = blended[i];
    EXPECT_NEAR(depths[i], want.depth, 1e-5);
    EXPECT_NEAR(got.x, want.blended.x, 1e-3) << i;
    EXPECT_NEAR(got.y, want.blended.y, 1e-3) << i;
    const double pairs[][2] = {{got.a, want.blended.a},
                               {got.b, want.blended.b},
                               {got.c, want.blended.c},
                               {got.opacity, want.blended.opacity},
                               {got.rgb[0], want.blended.rgb[0]},
                               {got.rgb[1], want.blended.rgb[1]},
                               {got.rgb[2], want.blended.rgb[2]},
                               {got.reach_x, want.blended.reach_x},
                               {got.reach_y, want.blended.reach_y},
                               {got.max_distance_squared, want.blended.max_distance_squared}};
    for (const auto& [value, wanted] : pairs) EXPECT_NEAR(value, wanted, 1e-5 + 1e-4 * std::abs(wanted)) << i;
  }
  EXPECT_GT(n_seen, 200);
  EXPECT_LT(n_in_vain, n_beside / 5) << "most that are not in the picture are left out";
}

// The loss is the sum of what is blended, each value with a weight of its own.
constexpr std::array<double, 9> kWeights = {0.7, -0.4, 3, 2, -5, 0.9, 0.6, -0.8, 0.5};

double Loss(const WideValues& row) {
  const auto& b = Reference(row).blended;
  const std::array<double, 9> values = {b.x, b.y, b.a, b.b, b.c, b.opacity, b.rgb[0], b.rgb[1], b.rgb[2]};
  double loss = 0;
  for (std::size_t i = 0; i < values.size(); ++i) loss += kWeights[i] * values[i];
  return loss;
}

TEST_P(SplatProjection, HasTheGradientOfTheReference) {
  constexpr std::size_t kNumber = 400;
  const Values values = SomeSplats(kNumber);
  std::vector<BlendedSplat> blended(kNumber);
  std::vector<float> depths(kNumber);
  build_->project_splats(SomeCamera(), ArraysOf(values), 0, kNumber, blended.data(), depths.data());
  std::vector<std::uint32_t> seen;
  for (std::uint32_t i = 0; i < kNumber; ++i) {
    if (depths[i] > 1) seen.push_back(i);  // nearer ones bend too much for the differences
  }
  ASSERT_GT(seen.size(), 30u);
  BlendedSplatGradient by;
  float* by_values = &by.x;
  for (std::size_t i = 0; i < kWeights.size(); ++i) by_values[i] = static_cast<float>(kWeights[i]);
  const std::vector<BlendedSplatGradient> by_blended(seen.size(), by);
  constexpr float kUntouched = 77;
  Values gradients = values;
  for (std::vector<float>& kind : gradients) std::fill(kind.begin(), kind.end(), kUntouched);
  build_->project_splats_gradient(SomeCamera(),
                                  ArraysOf(values),
                                  seen.data(),
                                  static_cast<int>(seen.size()),
                                  by_blended.data(),
                                  {gradients[0].data(),
                                   gradients[1].data(),
                                   gradients[2].data(),
                                   gradients[3].data(),
                                   gradients[4].data()});
  std::size_t next = 0, n_linearised_aside = 0;
  for (std::size_t i = 0; i < kNumber; ++i) {
    if (next == seen.size() || i != seen[next]) {
      for (const auto& kind : gradients) EXPECT_EQ(kind[i * kind.size() / kNumber], kUntouched);
      continue;
    }
    ++next;
    n_linearised_aside += blended[i].x < 0 || blended[i].x > 64;
    WideValues row = Row(values, i);
    for (std::size_t kind = 0; kind < row.size(); ++kind) {
      for (std::size_t k = 0; k < row[kind].size(); ++k) {
        constexpr double kStep = 1e-5;
        const double before = row[kind][k];
        row[kind][k] = before + kStep;
        const double high = Loss(row);
        row[kind][k] = before - kStep;
        const double want = (high - Loss(row)) / (2 * kStep);
        row[kind][k] = before;
        const float got = gradients[kind][i * row[kind].size() + k];
        EXPECT_NEAR(got, want, 2e-3 + 1e-3 * std::abs(want)) << "splat " << i << ", " << kind << ", " << k;
      }
    }
  }
  EXPECT_GT(n_linearised_aside, 0u);
}

INSTANTIATE_TEST_SUITE_P(Builds,
                         SplatProjection,
                         testing::Values("portable", "avx2", "avx512", "avx512bf16"),
                         [](const auto& build) { return build.param; });

}  // namespace
}  // namespace nerf
