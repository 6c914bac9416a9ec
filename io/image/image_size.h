// Size of a picture as its file's header states it, without decoding pixels.
#pragma once

#include <filesystem>
#include <optional>

namespace io {

struct ImageSize {
  int width = 0, height = 0;
};

// PNG and JPEG are read from their headers (a few kilobytes); other formats are decoded. EXIF orientation is
// not applied, as in ReadImage. Throws kBadInput when the file is no picture or a side exceeds 65535 pixels.
ImageSize ReadImageSize(const std::filesystem::path& path);

// The same of PNG and JPEG; nothing of other formats, and where the header is damaged or cannot be read.
std::optional<ImageSize> ReadHeaderSize(const std::filesystem::path& path);

}  // namespace io
