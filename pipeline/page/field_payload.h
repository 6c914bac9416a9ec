// The numbers of a trained `hash` field as the page's shader reads them (field.glsl).
//
//   weights   float32, three blocks of 4 x 4 matrices by columns, in the order of the shader's uniform blocks
//   splats    where there are any, see splat_payload.h
//   shares    with them, the cells of ShareMap; or one for all
//   table     RGBA8, an entry of the hash grid per texel: a feature is stored as the signed root of its share
//             of the level's largest, so that small ones keep their digits
//   march     a byte per occupancy cell: 0: occupied; d > 0: a ray may advance d - 1 cells, as in
//             kernels/march_reference.h
//   trained   a byte per cell of TrainedCells: 255 where hashed levels count, 128 near such cells, 0 where no
//             photograph showed anything, which is veiled
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "nerf/fields/scene_field.h"

namespace pipeline {

struct FieldPayload {
  std::string description;  // JSON: sizes, scales, space, sampling, and where each part begins
  std::string bytes;
};

// The field must be of kind `hash`. has_alpha: of the pictures that it was trained on.
FieldPayload MakeFieldPayload(nerf::SceneField* scene_field, bool has_alpha);

// Features [n][4] of a level, and the largest magnitude of each of the four.
struct QuantizedLevel {
  std::vector<std::uint8_t> texels;
  std::array<float, 4> scale;
};
QuantizedLevel QuantizeLevel(std::span<const float> features);

// What the shader makes of a texel's channel.
inline float Dequantize(std::uint8_t value, float scale) {
  const float root = (static_cast<float>(value) - 128.f) / 127.f;
  return scale * root * (root < 0 ? -root : root);
}

}  // namespace pipeline
