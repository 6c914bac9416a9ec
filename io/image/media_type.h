// What a file holds, told by its first bytes; names and extensions are not believed.
#pragma once

#include <string_view>

namespace io {

enum class MediaType {
  kUnknown,
  kJpeg,
  kPng,
  kTiff,
  kWebp,
  kHeif,
  kGif,        // recognised only to be refused by name
  kBmp,        // as kGif
  kCameraRaw,  // as kGif; raw files in a TIFF container are told apart when decoding
  kMp4,        // MP4 and QuickTime
  kMatroska,   // also WebM
  kAvi,
};

inline constexpr char kAcceptedPhotos[] = "JPEG, PNG, TIFF, WebP, HEIC";
inline constexpr char kAcceptedVideos[] = "MP4/MOV, Matroska/WebM, AVI";
inline constexpr int kMediaTypeBytes = 16;  // the first bytes of a file that MediaTypeOf looks at

MediaType MediaTypeOf(std::string_view head);
const char* MediaTypeName(MediaType type);
bool IsPhoto(MediaType type);  // one of kAcceptedPhotos
bool IsVideo(MediaType type);  // one of kAcceptedVideos

}  // namespace io
