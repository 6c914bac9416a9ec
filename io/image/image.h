// 8-bit sRGB pictures: interleaved rows, top to bottom, 3 channels (RGB) or 4 (RGB + straight alpha).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace io {

struct Image {
  int width = 0, height = 0, channels = 3;
  std::vector<std::uint8_t> data;  // [height][width][channels]

  std::uint8_t* Pixel(int x, int y) {
    return &data[static_cast<std::size_t>((std::ptrdiff_t{y} * width + x) * channels)];
  }
  const std::uint8_t* Pixel(int x, int y) const {
    return &data[static_cast<std::size_t>((std::ptrdiff_t{y} * width + x) * channels)];
  }
};

Image MakeImage(int width, int height, int channels);

// Reads a PNG, JPEG, TIFF or WebP by the decoders of io/image/photo.h, without applying EXIF orientation
// (files inside a run folder carry none). Grey becomes RGB; 16 bits become 8 by rounding v / 257. Throws
// kBadInput, for damaged and truncated files as well.
Image ReadImage(const std::filesystem::path& path);

// Writes PNG (lossless) or JPEG (by extension; quality 95, colour at half resolution: for viewing only),
// atomically. Throws kNoResources.
void WriteImage(const std::filesystem::path& path, const Image& image);

// The same bytes WriteImage would write, for embedding. extension: ".png" or ".jpg".
std::vector<std::uint8_t> EncodeImage(const Image& image, const char* extension);

// Area average (each target pixel is the mean of the source area it covers). RGBA is averaged premultiplied
// and returned straight, so that resizing and compositing commute.
Image ResizeArea(const Image& image, int width, int height);

// The colours of an RGBA picture as they are stored.
Image WithoutAlpha(const Image& image);

// rgb * alpha + (1 - alpha) * background, background in [0, 255]. RGB pictures are returned unchanged.
Image CompositeOn(const Image& image, std::uint8_t background);

}  // namespace io
