// Numbers as colours: perceptual colour maps for error and depth pictures.
#pragma once

#include <vector>

#include "io/image/image.h"

namespace io {

enum class ColourMap {
  kMagma,  // black to light yellow, lightness grows evenly: errors
  kTurbo,  // blue to red, many hues: depth
};

// values[height * width] in [0, 1], clamped; NaN becomes 0.
Image ApplyColourMap(const std::vector<float>& values, int width, int height, ColourMap map);

}  // namespace io
