#include "pipeline/page/splat_payload.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace pipeline {
namespace {

using nerf::Splats;

constexpr int kValues = 3 * nerf::kHarmonics;  // of a splat's colour

std::uint32_t Word(const std::array<float, 4>& bytes) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto byte = static_cast<std::uint32_t>(std::clamp(std::lround(bytes[i]), 0l, 255l));
    word |= byte << (8 * i);
  }
  return word;
}

// How values become bytes.
struct Steps {
  float lowest_scale = 0, scale = 1, colour[2] = {1, 1};
};

Steps StepsOf(const Splats& splats) {
  const auto [low, high] = std::minmax_element(splats.log_scales.begin(), splats.log_scales.end());
  constexpr float kLeast = 1e-6f;  // where all values are equal
  float most[2] = {kLeast, kLeast};
  for (std::size_t i = 0; i < splats.colours.size(); ++i) {
    float& largest = most[i % kValues < 3 ? 0 : 1];
    largest = std::max(largest, std::fabs(splats.colours[i]));
  }
  return {.lowest_scale = *low,
          .scale = std::max(kLeast, (*high - *low) / 255),
          .colour = {most[0] / 127, most[1] / 127}};
}

void AppendSplat(const Splats& splats, std::size_t i, const Steps& steps, std::vector<std::uint32_t>* words) {
  for (std::size_t k = 0; k < 3; ++k)
    words->push_back(std::bit_cast<std::uint32_t>(splats.places[3 * i + k]));
  std::array<float, 4> q;
  float length = 0;
  for (std::size_t k = 0; k < 4; ++k) length = std::hypot(length, q[k] = splats.rotations[4 * i + k]);
  for (float& value : q) value = 128 + 127 * value / length;
  words->push_back(Word(q));

  std::array<float, kValues> colour;
  for (std::size_t k = 0; k < kValues; ++k)
    colour[k] = 128 + splats.colours[kValues * i + k] / steps.colour[k < 3 ? 0 : 1];
  std::array<float, 3> scale;
  for (std::size_t k = 0; k < 3; ++k)
    scale[k] = (splats.log_scales[3 * i + k] - steps.lowest_scale) / steps.scale;
  const float opacity = 255 / (1 + std::exp(-splats.opacities[i]));
  words->push_back(Word({scale[0], scale[1], scale[2], colour[11]}));
  words->push_back(Word({opacity, colour[0], colour[1], colour[2]}));
  words->push_back(Word({colour[3], colour[4], colour[5], colour[6]}));
  words->push_back(Word({colour[7], colour[8], colour[9], colour[10]}));
}

}  // namespace

SplatPayload MakeSplatPayload(const nerf::SceneField& scene_field) {
  const Splats& splats = scene_field.splats;
  const Steps steps = StepsOf(splats);
  SplatPayload payload;
  for (std::size_t i = 0; i < splats.size(); ++i) AppendSplat(splats, i, steps, &payload.words);
  payload.description = {{"share", scene_field.splat_share},
                         {"focal_px", scene_field.splat_focal_px},
                         {"low_pass", nerf::kLowPass},
                         {"slope_margin", nerf::kSlopeMargin},
                         {"nearest", nerf::kNearestSplat},
                         {"constants",
                          {{"NEAREST", nerf::kNearestSplat},
                           {"MIN_ALPHA", nerf::kernels::kMinSplatAlpha},
                           {"MAX_ALPHA", nerf::kernels::kMaxSplatAlpha},
                           {"HARMONIC0", nerf::kHarmonic0},
                           {"HARMONIC1", nerf::kHarmonic1},
                           {"LOWEST_SCALE", steps.lowest_scale},
                           {"SCALE_STEP", steps.scale},
                           {"COLOUR0", steps.colour[0]},
                           {"COLOUR1", steps.colour[1]}}}};
  return payload;
}

}  // namespace pipeline
