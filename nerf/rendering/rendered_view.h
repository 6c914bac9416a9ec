// A rendered picture with its depth and opacity.
#pragma once

#include <vector>

namespace nerf {

struct RenderedView {
  int width = 0, height = 0;
  std::vector<float> rgb;      // [height][width][3], sRGB in [0, 1], background included
  std::vector<float> depth;    // [height][width], expected depth along the ray in scene units
  std::vector<float> opacity;  // [height][width], sum of weights
  // [height][width], distance at which half of a ray's light is absorbed; infinite where less is. The place
  // of the surface, with one ray per pixel; expected depth mixes what is before and behind an edge.
  std::vector<float> median_depth = {};
  // [height][width], share of the light that comes from where the field learnt nothing.
  std::vector<float> unlearnt = {};
};

// The view with more pixels: each value between those around it, but the median depth of the nearest pixel,
// which is on one side of an edge.
RenderedView Magnified(const RenderedView& view, int width, int height);

}  // namespace nerf
