#include "io/image/media_type.h"

#include <algorithm>
#include <array>

namespace io {
namespace {

using std::string_view_literals::operator""sv;

// Files in the ISO base media format carry "ftyp" and a brand: still pictures, camera raw, or a film.
MediaType TypeOfBrand(std::string_view brand) {
  constexpr std::array kStill = {
      "heic"sv, "heix"sv, "heim"sv, "heis"sv, "hevc"sv, "mif1"sv, "msf1"sv, "avif"sv};
  if (std::find(kStill.begin(), kStill.end(), brand) != kStill.end()) return MediaType::kHeif;
  return brand == "crx "sv ? MediaType::kCameraRaw : MediaType::kMp4;
}

}  // namespace

MediaType MediaTypeOf(std::string_view head) {
  const auto has = [&](std::size_t offset, std::string_view magic) {
    return head.size() >= offset + magic.size() && head.substr(offset, magic.size()) == magic;
  };
  if (has(0, "\xff\xd8\xff"sv)) return MediaType::kJpeg;
  if (has(0, "\x89PNG\r\n\x1a\n"sv)) return MediaType::kPng;
  if (has(0, "II*\0"sv) || has(0, "MM\0*"sv))
    return has(8, "CR"sv) ? MediaType::kCameraRaw : MediaType::kTiff;
  if (has(0, "RIFF"sv) && has(8, "WEBP"sv)) return MediaType::kWebp;
  if (has(0, "RIFF"sv) && has(8, "AVI "sv)) return MediaType::kAvi;
  if (has(0, "\x1a\x45\xdf\xa3"sv)) return MediaType::kMatroska;
  if (has(4, "ftyp"sv) && head.size() >= 12) return TypeOfBrand(head.substr(8, 4));
  if (has(0, "GIF8"sv)) return MediaType::kGif;
  if (has(0, "BM"sv) && has(6, "\0\0\0\0"sv)) return MediaType::kBmp;
  if (has(0, "FUJIFILM"sv) || has(0, "IIRO"sv) || has(0, "IIU\0"sv)) return MediaType::kCameraRaw;
  return MediaType::kUnknown;
}

const char* MediaTypeName(MediaType type) {
  switch (type) {
    case MediaType::kJpeg:
      return "JPEG";
    case MediaType::kPng:
      return "PNG";
    case MediaType::kTiff:
      return "TIFF";
    case MediaType::kWebp:
      return "WebP";
    case MediaType::kHeif:
      return "HEIC";
    case MediaType::kGif:
      return "GIF";
    case MediaType::kBmp:
      return "BMP";
    case MediaType::kCameraRaw:
      return "camera raw";
    case MediaType::kMp4:
      return "MP4/MOV";
    case MediaType::kMatroska:
      return "Matroska/WebM";
    case MediaType::kAvi:
      return "AVI";
    case MediaType::kUnknown:
      break;
  }
  return "unknown";
}

bool IsPhoto(MediaType type) { return type >= MediaType::kJpeg && type <= MediaType::kHeif; }
bool IsVideo(MediaType type) { return type >= MediaType::kMp4; }

}  // namespace io
