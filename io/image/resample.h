// Pictures whose pixels are fetched from anywhere in another picture.
#pragma once

#include <cstddef>
#include <vector>

#include "io/image/image.h"
#include "io/image/mask.h"

namespace io {

// Where each pixel of a width x height picture comes from, row by row, in pixels of the source; the centre of
// its top-left pixel is (0.5, 0.5).
struct PixelSources {
  PixelSources() = default;
  PixelSources(int w, int h)
      : width(w), height(h), x(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)), y(x.size()) {}

  int width = 0, height = 0;
  std::vector<float> x, y;
};

// Interpolated with Lanczos' kernel (8 x 8); beyond the border lies its nearest pixel. Colours of transparent
// pixels mean nothing, so RGBA is interpolated premultiplied and returned straight.
Image Resample(const Image& image, const PixelSources& sources);

// Of the nearest pixel; beyond the border nothing is used.
Mask Resample(const Mask& mask, const PixelSources& sources);

}  // namespace io
