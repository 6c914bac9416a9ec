// Numbers by which pictures are chosen: how sharp, how bright, how like another one.
#pragma once

#include <array>
#include <cstdint>

#include "io/image/image.h"

namespace io {

// Mean squared spatial frequency of the grey picture at a longest side of 640 px, along its worst direction:
//   min over d of E[(second derivative along d)^2] / (E[(first derivative along d)^2] + 1)
// with d horizontal, vertical or diagonal, so that motion blur counts although it leaves the edges along the
// motion. Contrast and brightness cancel (the 1 grey level^2 keeps flat pictures near 0). It depends on the
// content, so compare it only among neighbours of one set.
double Sharpness(const Image& image);

// The grey picture averaged down to 32 x 32, whatever its aspect.
using Thumbnail = std::array<std::uint8_t, 32 * 32>;
Thumbnail MakeThumbnail(const Image& image);

// Mean absolute difference in grey levels, 0..255.
double Difference(const Thumbnail& a, const Thumbnail& b);

// Largest absolute difference in grey levels, 0..255.
int LargestDifference(const Thumbnail& a, const Thumbnail& b);

// Mean grey level, 0..255.
double Brightness(const Thumbnail& thumbnail);

}  // namespace io
