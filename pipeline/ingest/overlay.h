// What lies over every picture of a capture: a date, a logo, black bars, part of the vehicle or of the
// camera.
#pragma once

#include <vector>

#include "io/image/image.h"
#include "io/image/mask.h"

namespace pipeline {

// Lines of pixels along the sides of a picture.
struct Bars {
  int left = 0, top = 0, right = 0, bottom = 0;

  bool Any() const { return left + top + right + bottom > 0; }
};

struct Overlay {
  Bars bars;           // black, to be cropped
  io::Mask mask;       // of the whole picture: what stands still in it is not used; empty: nothing does
  double covered = 0;  // share of the pixels between the bars that the mask leaves out
};

// Fewer pictures may agree on a colour by chance.
inline constexpr int kMinOverlayPictures = 20;

// The overlay of pictures of one size, all of it in pixels of that size. A pixel stands still where nine in
// ten pictures have the same colour. A wall or a night sky does so too, but at its edge the pictures change
// their minds one by one; an overlay ends within a few pixels, beyond which they differ. The same goes for
// bars, whose inner neighbours are not black. What reaches all four sides, or covers more than half of the
// picture, is a background, and no overlay. Empty for fewer than kMinOverlayPictures.
Overlay FindOverlay(const std::vector<io::Image>& pictures, int threads);

// The overlay at another size of the same pictures, its bars rounded up and its mask a margin wider.
Overlay ResizedOverlay(const Overlay& overlay, int from_width, int from_height, int width, int height);

}  // namespace pipeline
