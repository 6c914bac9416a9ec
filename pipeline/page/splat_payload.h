// The scene's splats as the page's shader reads them (splat_vertex.glsl): two RGBA32UI texels each,
//
//   x, y, z   float32, scene units
//   rotation  w x y z, a byte each: 128 + 127 q for q of length 1
//   look 0    bytes: log scales, (l - lowest_scale) / scale_step; the last harmonic of blue
//   look 1    bytes: opacity, 255 of it; first harmonic of red, green, blue
//   look 2, 3 bytes: the other harmonics of r, g, b, in their order, but the last
//
// with harmonics as 128 + k / colour_step, one step for the first and one for the others.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/splatting/splats.h"

namespace pipeline {

struct SplatPayload {
  float lowest_scale = 0, scale_step = 1;
  float colour_steps[2] = {1, 1};    // of first harmonics and of the others
  std::vector<std::uint32_t> words;  // [n][8]
};

// At least one splat.
SplatPayload MakeSplatPayload(const nerf::Splats& splats);

}  // namespace pipeline
