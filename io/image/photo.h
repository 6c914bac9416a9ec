// A user's picture, whatever file it came in: decoded, upright, 8-bit, no larger than asked for.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/image/image.h"

namespace io {

struct Photo {
  Image image;          // RGB, or RGBA when some pixel is not opaque; EXIF orientation applied
  int orientation = 1;  // the EXIF orientation that was applied
  int full_width = 0, full_height = 0;  // upright, before resizing
  std::optional<double> focal_px;       // of `image`, from EXIF
  std::string make, model;              // of the camera; empty when unknown
  std::vector<std::string> notes;       // what was converted or ignored, for the user
};

// file: the bytes of a JPEG, PNG, TIFF, WebP or HEIC file, told apart by content. max_side limits the longest
// side [px] by area averaging; smaller pictures keep their size. Throws kBadInput with the reason, without a
// file name: truncated, damaged, oversized, or of a kind that is not read.
Photo DecodePhoto(std::string_view file, int max_side);

// Bytes that DecodePhoto takes at most, its input included: 16 per pixel, as for 16 bits with alpha; photos
// of 8 bits take 11.
struct DecodingCost {
  std::size_t bytes;
  bool is_known;  // by the size in the header; else, of other kinds and of what is no picture, the largest
                  // photo's
};
DecodingCost CostOfDecoding(const std::filesystem::path& file);

// EXIF 2.32 tag 274. orientation in 1..8 says where row 0 and column 0 of the stored picture belong.
Image ApplyOrientation(const Image& stored, int orientation);

// The largest size with the same aspect whose longest side is at most max_side; never larger than the
// picture.
void FitWithin(int max_side, int* width, int* height);

}  // namespace io
