// The splats that the page's shader reads: bytes lead back to the values.
#include "pipeline/page/splat_payload.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "tests/support/scenes/some_splats.h"

namespace pipeline {
namespace {

double Byte(std::uint32_t word, int i) { return word >> (8 * i) & 255u; }

TEST(SplatPayload, LeadsBackToTheValues) {
  const nerf::Splats splats = tests::SomeSplats(50);
  const SplatPayload payload = MakeSplatPayload(splats);
  ASSERT_EQ(payload.words.size(), 8 * splats.size());
  const double scale_step = payload.scale_step;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const std::uint32_t* words = &payload.words[8 * i];
    double length = 0;
    for (std::size_t k = 0; k < 4; ++k) length = std::hypot(length, splats.rotations[4 * i + k]);
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(std::bit_cast<float>(words[k]), splats.places[3 * i + k]);
      EXPECT_NEAR(payload.lowest_scale + scale_step * Byte(words[4], static_cast<int>(k)),
                  splats.log_scales[3 * i + k],
                  0.501 * scale_step);
    }
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_NEAR(
          (Byte(words[3], static_cast<int>(k)) - 128) / 127, splats.rotations[4 * i + k] / length, 0.0041);
    EXPECT_NEAR(Byte(words[5], 0) / 255, 1 / (1 + std::exp(-splats.opacities[i])), 0.00201);
    // The bytes of the harmonics, in their order.
    const double bytes[] = {Byte(words[5], 1),
                            Byte(words[5], 2),
                            Byte(words[5], 3),
                            Byte(words[6], 0),
                            Byte(words[6], 1),
                            Byte(words[6], 2),
                            Byte(words[6], 3),
                            Byte(words[7], 0),
                            Byte(words[7], 1),
                            Byte(words[7], 2),
                            Byte(words[7], 3),
                            Byte(words[4], 3)};
    for (std::size_t k = 0; k < 12; ++k) {
      const double step = payload.colour_steps[k < 3 ? 0 : 1];
      EXPECT_NEAR((bytes[k] - 128) * step, splats.colours[12 * i + k], 0.501 * step) << k;
    }
  }
}

TEST(SplatPayload, EqualValuesAreNoDivisionByZero) {
  nerf::Splats splats;
  splats.resize(2);  // all zero but their turn
  for (std::size_t i = 0; i < 2; ++i) splats.rotations[4 * i] = 1;
  const SplatPayload payload = MakeSplatPayload(splats);
  EXPECT_EQ(Byte(payload.words[5], 0), 128);  // opacity 1 / 2
  EXPECT_EQ(Byte(payload.words[5], 1), 128);  // no colour
  EXPECT_EQ(Byte(payload.words[4], 0), 0);
}

}  // namespace
}  // namespace pipeline
