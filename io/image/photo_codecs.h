// The decoders behind io/image/photo.h. Each takes a whole file, checks the size in its header before it
// allocates, and returns stored pixels as 8-bit RGB or RGBA, before EXIF orientation. They append notes on
// what they converted and throw kBadInput with the reason (without the file's name).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "io/image/image.h"
#include "io/image/photo_tags.h"

namespace io {

inline constexpr int kMaxPhotoSide = 32768;       // [px] every decoder in use is safe below it
inline constexpr double kMaxPhotoPixels = 100e6;  // a decompression bomb above, whatever the file's size

// Throws kBadInput unless 1 <= width, height <= kMaxPhotoSide and width * height <= kMaxPhotoPixels.
void CheckPhotoSize(double width, double height);

// libjpeg directly: only its warning count tells a whole file from a cut one.
Image DecodeJpeg(std::string_view file, std::vector<std::string>* notes);

// libheif; it applies the container's own rotation and mirroring, so tags->orientation is set to 1.
Image DecodeHeif(std::string_view file, PhotoTags* tags, std::vector<std::string>* notes);

// PNG, TIFF, WebP through OpenCV, behind our own reading of the header, and what else OpenCV knows. Throws
// std::bad_alloc where OpenCV lacks memory.
Image DecodeWithOpenCv(std::string_view file, std::vector<std::string>* notes);

}  // namespace io
