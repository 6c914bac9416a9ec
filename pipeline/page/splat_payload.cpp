#include "pipeline/page/splat_payload.h"

#include <algorithm>
#include <array>
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

SplatPayload StepsOf(const Splats& splats) {
  const auto [low, high] = std::minmax_element(splats.log_scales.begin(), splats.log_scales.end());
  constexpr float kLeast = 1e-6f;  // where all values are equal
  float most[2] = {kLeast, kLeast};
  for (std::size_t i = 0; i < splats.colours.size(); ++i) {
    float& largest = most[i % kValues < 3 ? 0 : 1];
    largest = std::max(largest, std::fabs(splats.colours[i]));
  }
  return {.lowest_scale = *low,
          .scale_step = std::max(kLeast, (*high - *low) / 255),
          .colour_steps = {most[0] / 127, most[1] / 127},
          .words = {}};
}

void AppendSplat(const Splats& splats, std::size_t i, SplatPayload* payload) {
  std::vector<std::uint32_t>* const words = &payload->words;
  for (std::size_t k = 0; k < 3; ++k)
    words->push_back(std::bit_cast<std::uint32_t>(splats.places[3 * i + k]));
  std::array<float, 4> q;
  float length = 0;
  for (std::size_t k = 0; k < 4; ++k) length = std::hypot(length, q[k] = splats.rotations[4 * i + k]);
  for (float& value : q) value = 128 + 127 * value / length;
  words->push_back(Word(q));

  std::array<float, kValues> colour;
  for (std::size_t k = 0; k < kValues; ++k)
    colour[k] = 128 + splats.colours[kValues * i + k] / payload->colour_steps[k < 3 ? 0 : 1];
  std::array<float, 3> scale;
  for (std::size_t k = 0; k < 3; ++k)
    scale[k] = (splats.log_scales[3 * i + k] - payload->lowest_scale) / payload->scale_step;
  const float opacity = 255 / (1 + std::exp(-splats.opacities[i]));
  words->push_back(Word({scale[0], scale[1], scale[2], colour[11]}));
  words->push_back(Word({opacity, colour[0], colour[1], colour[2]}));
  words->push_back(Word({colour[3], colour[4], colour[5], colour[6]}));
  words->push_back(Word({colour[7], colour[8], colour[9], colour[10]}));
}

}  // namespace

SplatPayload MakeSplatPayload(const Splats& splats) {
  SplatPayload payload = StepsOf(splats);
  for (std::size_t i = 0; i < splats.size(); ++i) AppendSplat(splats, i, &payload);
  return payload;
}

}  // namespace pipeline
