// Which pixels of a picture count: a subject without its moving surroundings, a street without passers-by.
// In files a mask is a picture of the same size; white (128 or more) is used, black is not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "io/image/image.h"

namespace io {

struct Mask {
  int width = 0, height = 0;
  std::vector<std::uint8_t> used;  // [height][width], 255: used, 0: not; empty: every pixel is used

  bool Uses(std::size_t pixel) const { return used.empty() || used[pixel] != 0; }
  std::size_t UsedCount() const;  // of a mask that is not empty
};

// Colour counts by its luma (ITU-R BT.601), and a transparent pixel is black.
Mask MaskFromImage(const Image& image);

// A PNG or JPEG as io/image/image.h reads it. Throws kBadInput when it is not width x height pixels or none
// of them is used.
Mask ReadMask(const std::filesystem::path& path, int width, int height);

// Writes an 8-bit grey PNG, as nerfstudio and COLMAP read masks, atomically. Throws kNoResources.
void WriteMask(const std::filesystem::path& path, const Mask& mask);

// Of a smaller picture: a pixel is used when at least half of the area that it covers is.
Mask ShrinkMask(const Mask& mask, int width, int height);

}  // namespace io
