#include "io/image/image_size.h"

#include <array>
#include <cstring>
#include <fstream>

#include "io/base/error.h"
#include "io/image/image.h"

namespace io {
namespace {

using Bytes = std::array<unsigned char, 24>;

int BigEndian(const unsigned char* bytes, int count) {
  int value = 0;
  for (int i = 0; i < count; ++i) value = value << 8 | bytes[i];
  return value;
}

// Walks the JPEG segments up to the first start-of-frame; {0, 0} when there is none.
ImageSize JpegSize(std::ifstream& in) {
  in.seekg(2);
  for (Bytes b; in.read(reinterpret_cast<char*>(b.data()), 2);) {
    if (b[0] != 0xFF) return {};
    while (b[1] == 0xFF && in.read(reinterpret_cast<char*>(&b[1]), 1)) {
    }
    const int marker = b[1];
    if (marker == 0x01 || (marker >= 0xD0 && marker <= 0xD7)) continue;  // markers without a segment
    if (!in.read(reinterpret_cast<char*>(b.data()), 2)) return {};
    const int length = BigEndian(b.data(), 2);
    const bool is_start_of_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_start_of_frame) {
      if (!in.read(reinterpret_cast<char*>(b.data()), 5)) return {};
      return {BigEndian(b.data() + 3, 2), BigEndian(b.data() + 1, 2)};
    }
    const bool is_end_or_scan = marker == 0xD9 || marker == 0xDA;
    if (is_end_or_scan || length < 2 || !in.seekg(length - 2, std::ios::cur)) return {};
  }
  return {};
}

}  // namespace

std::optional<ImageSize> ReadHeaderSize(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  Bytes b{};
  if (!in.read(reinterpret_cast<char*>(b.data()), b.size())) return std::nullopt;
  ImageSize size;
  if (std::memcmp(b.data(), "\x89PNG\r\n\x1a\n", 8) == 0) {
    // 65535 is far beyond any photograph; the two upper bytes of a larger side make the number useless here.
    if (BigEndian(b.data() + 16, 2) == 0 && BigEndian(b.data() + 20, 2) == 0)
      size = {BigEndian(b.data() + 18, 2), BigEndian(b.data() + 22, 2)};
  } else if (b[0] == 0xFF && b[1] == 0xD8) {
    size = JpegSize(in);
  }
  if (size.width <= 0 || size.height <= 0) return std::nullopt;
  return size;
}

ImageSize ReadImageSize(const std::filesystem::path& path) {
  if (const std::optional<ImageSize> size = ReadHeaderSize(path)) return *size;
  std::ifstream in(path, std::ios::binary);
  Bytes b{};
  in.read(reinterpret_cast<char*>(b.data()), b.size());
  const bool is_png = in.good() && std::memcmp(b.data(), "\x89PNG\r\n\x1a\n", 8) == 0,
             is_jpeg = in.good() && b[0] == 0xFF && b[1] == 0xD8;
  if (is_png || is_jpeg)
    throw Error(ExitCode::kBadInput, path.string() + ": its header is damaged", "Save the picture again");
  const Image image = ReadImage(path);
  return {image.width, image.height};
}

}  // namespace io
