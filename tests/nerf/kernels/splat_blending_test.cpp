// Blending of every build against its plain reference, and its gradient against differences of that.
#include <gtest/gtest.h>

#include <vector>

#include "io/base/random.h"
#include "nerf/kernels/kernels.h"
#include "nerf/kernels/splat_blending_reference.h"

namespace nerf {
namespace {

using kernels::BlendedSplat;
using kernels::BlendedSplatGradient;
using kernels::Kernels;
using kernels::kMinSplatAlpha;
using kernels::kTilePixels;
using kernels::kTileSide;
using DoubleSplat = kernels::BlendedSplatOf<double>;

constexpr int kX = 32, kY = 16;  // the tile's first pixel

// Splats of all shapes in and around the tile, nearest first: so many that some pixels become opaque.
std::vector<BlendedSplat> SomeSplats(int n, float most_opacity) {
  std::vector<BlendedSplat> splats;
  for (int i = 0; i < n; ++i) {
    io::Random random(1, io::Stream::kSplat, 0, static_cast<std::uint64_t>(i));
    const float xx = 0.3f + 12 * random.Uniform(), yy = 0.3f + 12 * random.Uniform(),
                xy = (1.6f * random.Uniform() - 0.8f) * std::sqrt(xx * yy), det = xx * yy - xy * xy;
    BlendedSplat splat = {};
    splat.x = kX - 4 + 24 * random.Uniform(), splat.y = kY - 4 + 24 * random.Uniform();
    splat.a = yy / det, splat.b = -xy / det, splat.c = xx / det;
    splat.opacity = kMinSplatAlpha + (most_opacity - kMinSplatAlpha) * random.Uniform();
    for (float& value : splat.rgb) value = random.Uniform();
    const float deviations = std::sqrt(2 * std::log(splat.opacity / kMinSplatAlpha));
    splat.reach_x = deviations * std::sqrt(xx), splat.reach_y = deviations * std::sqrt(yy);
    splat.max_distance_squared = deviations * deviations;
    splats.push_back(splat);
  }
  return splats;
}

DoubleSplat Widened(const BlendedSplat& s) {
  return {s.x,
          s.y,
          s.a,
          s.b,
          s.c,
          s.opacity,
          {s.rgb[0], s.rgb[1], s.rgb[2]},
          s.reach_x,
          s.reach_y,
          s.max_distance_squared};
}

struct Blended {
  std::vector<double> rgb = std::vector<double>(3 * kTilePixels);  // planes
  std::vector<double> transmittance = std::vector<double>(kTilePixels, 1);
};

Blended Reference(const std::vector<DoubleSplat>& splats) {
  Blended out;
  for (int at = 0; at < kTilePixels; ++at) {
    double rgb[3] = {};
    for (const DoubleSplat& splat : splats)
      kernels::reference::BlendSplat(splat,
                                     kX + at % kTileSide,
                                     kY + at / kTileSide,
                                     rgb,
                                     &out.transmittance[static_cast<std::size_t>(at)]);
    for (int c = 0; c < 3; ++c) out.rgb[static_cast<std::size_t>(c * kTilePixels + at)] = rgb[c];
  }
  return out;
}

// A weight for each value of the picture; the loss is their product, before a background.
float Weight(int value) {
  return io::Random(2, io::Stream::kSplat, 0, static_cast<std::uint64_t>(value)).Uniform() - 0.3f;
}
constexpr double kBackground[] = {0.3, 0.6, 0.9};

double Loss(const Blended& blended) {
  double loss = 0;
  for (int i = 0; i < 3 * kTilePixels; ++i)
    loss += Weight(i) *
            (blended.rgb[static_cast<std::size_t>(i)] +
             blended.transmittance[static_cast<std::size_t>(i % kTilePixels)] * kBackground[i / kTilePixels]);
  return loss;
}

class Splats : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    build_ = kernels::FindKernels(GetParam());
    if (!build_) GTEST_SKIP() << "this CPU lacks it";
  }
  const Kernels* build_ = nullptr;
};

TEST_P(Splats, AreBlendedAsTheReferenceDoes) {
  for (const int n : {0, 1, 3, 900}) {
    const std::vector<BlendedSplat> splats = SomeSplats(n, 1);
    std::vector<float> rgb(3 * kTilePixels), transmittance(kTilePixels, 1);
    build_->blend_splats(splats.data(), n, kX, kY, rgb.data(), transmittance.data());
    std::vector<DoubleSplat> wide;
    for (const BlendedSplat& splat : splats) wide.push_back(Widened(splat));
    const Blended want = Reference(wide);
    int n_opaque = 0;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      n_opaque += want.transmittance[i] < double{kernels::kOpaqueSplats};
      ASSERT_NEAR(transmittance[i], want.transmittance[i], 1e-5) << n << " splats, pixel " << i;
      for (std::size_t c = 0; c < 3; ++c)
        ASSERT_NEAR(rgb[c * kTilePixels + i], want.rgb[c * kTilePixels + i], 1e-5) << n << " splats, " << i;
    }
    EXPECT_EQ(n_opaque > 100, n == 900);
  }
}

TEST_P(Splats, HaveTheGradientOfTheReference) {
  // Without thresholds that a difference would cross: none clamped at 0.99, few near the least alpha.
  const std::vector<BlendedSplat> splats = SomeSplats(24, 0.95f);
  std::vector<DoubleSplat> wide;
  for (const BlendedSplat& splat : splats) wide.push_back(Widened(splat));
  const Blended finished = Reference(wide);
  std::vector<float> weights, to_come(kTilePixels);
  for (int i = 0; i < 3 * kTilePixels; ++i) {
    weights.push_back(Weight(i));
    const auto pixel = static_cast<std::size_t>(i % kTilePixels);
    to_come[pixel] +=
        static_cast<float>(Weight(i) * (finished.rgb[static_cast<std::size_t>(i)] +
                                        finished.transmittance[pixel] * kBackground[i / kTilePixels]));
  }
  std::vector<BlendedSplatGradient> gradients(splats.size());
  build_->blend_splats_gradient(splats.data(),
                                static_cast<int>(splats.size()),
                                kX,
                                kY,
                                weights.data(),
                                to_come.data(),
                                gradients.data());
  double DoubleSplat::*const fields[] = {&DoubleSplat::x,
                                         &DoubleSplat::y,
                                         &DoubleSplat::a,
                                         &DoubleSplat::b,
                                         &DoubleSplat::c,
                                         &DoubleSplat::opacity};
  constexpr double kStep = 1e-6;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const auto difference = [&](double* value) {
      const double before = *value;
      *value = before + kStep;
      const double high = Loss(Reference(wide));
      *value = before - kStep;
      const double low = Loss(Reference(wide));
      *value = before;
      return (high - low) / (2 * kStep);
    };
    const BlendedSplatGradient& got = gradients[i];
    const double values[] = {got.x, got.y, got.a, got.b, got.c, got.opacity};
    for (std::size_t f = 0; f < 6; ++f) {
      const double want = difference(&(wide[i].*fields[f]));
      EXPECT_NEAR(values[f], want, 2e-3 + 2e-3 * std::abs(want)) << "splat " << i << ", value " << f;
    }
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(got.rgb[c], difference(&wide[i].rgb[c]), 1e-4) << "splat " << i << ", channel " << c;
  }
}

TEST_P(Splats, BehindAnOpaqueTileHaveNoGradient) {
  std::vector<BlendedSplat> splats(40, SomeSplats(1, 1)[0]);
  for (BlendedSplat& splat : splats) {
    splat.x = kX + 8, splat.y = kY + 8, splat.a = splat.c = 1e-4f, splat.b = 0, splat.opacity = 0.98f;
    splat.reach_x = splat.reach_y = 1000;
    splat.max_distance_squared = 2 * std::log(0.98f / kMinSplatAlpha);
  }
  const std::vector<float> weights(3 * kTilePixels, 1);
  std::vector<float> to_come(kTilePixels, 1);
  std::vector<BlendedSplatGradient> gradients(splats.size(), {.x = 7, .rgb = {7, 7, 7}});
  build_->blend_splats_gradient(splats.data(), 40, kX, kY, weights.data(), to_come.data(), gradients.data());
  EXPECT_GT(gradients[0].rgb[0], 200);
  EXPECT_EQ(gradients[39].rgb[0], 0);
  EXPECT_EQ(gradients[39].x, 0);
}

INSTANTIATE_TEST_SUITE_P(Builds,
                         Splats,
                         testing::Values("portable", "avx2", "avx512", "avx512bf16"),
                         [](const auto& build) { return build.param; });

}  // namespace
}  // namespace nerf
