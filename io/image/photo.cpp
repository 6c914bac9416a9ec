#include "io/image/photo.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "io/base/check.h"
#include "io/base/error.h"
#include "io/image/colour_profile.h"
#include "io/image/image_size.h"
#include "io/image/media_type.h"
#include "io/image/photo_codecs.h"
#include "io/image/photo_tags.h"

namespace io {
namespace {

// Fisheye to telescope; a tag that claims anything outside is wrong.
constexpr double kMinFocalPerSide = 0.1, kMaxFocalPerSide = 10.0;

Image DecodeStored(std::string_view file, PhotoTags* tags, std::vector<std::string>* notes) {
  const MediaType type = MediaTypeOf(file);
  if (type == MediaType::kHeif) return DecodeHeif(file, tags, notes);
  if (!IsPhoto(type)) {
    throw Error(ExitCode::kBadInput,
                type == MediaType::kUnknown ? std::string("the content is not a picture")
                                            : std::string(MediaTypeName(type)) + " is not read",
                "Convert it to PNG or JPEG");
  }
  Image image = type == MediaType::kJpeg ? DecodeJpeg(file, notes) : DecodeWithOpenCv(file, notes);
  *tags = ReadPhotoTags(file);
  return image;
}

bool IsOpaque(const Image& image) {
  for (std::size_t i = 3; i < image.data.size(); i += 4) {
    if (image.data[i] != 255) return false;
  }
  return true;
}

}  // namespace

void CheckPhotoSize(double width, double height) {
  if (width < 1 || height < 1 || width > kMaxPhotoSide || height > kMaxPhotoSide ||
      width * height > kMaxPhotoPixels) {
    throw Error(
        ExitCode::kBadInput,
        fmt::format(
            "the header says {:.0f} x {:.0f} pixels; the limit is {} a side and {:.0f} million in all",
            width,
            height,
            kMaxPhotoSide,
            kMaxPhotoPixels / 1e6));
  }
}

Image ApplyOrientation(const Image& stored, int orientation) {
  PIPELINE_CHECK(orientation >= 1 && orientation <= 8);
  if (orientation == 1) return stored;
  const bool transposed = orientation >= 5;
  const bool flip_x = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool flip_y = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  Image upright = MakeImage(
      transposed ? stored.height : stored.width, transposed ? stored.width : stored.height, stored.channels);
  for (int y = 0; y < upright.height; ++y) {
    for (int x = 0; x < upright.width; ++x) {
      int sx = transposed ? y : x, sy = transposed ? x : y;
      if (flip_x) sx = stored.width - 1 - sx;
      if (flip_y) sy = stored.height - 1 - sy;
      std::memcpy(upright.Pixel(x, y), stored.Pixel(sx, sy), static_cast<std::size_t>(stored.channels));
    }
  }
  return upright;
}

void FitWithin(int max_side, int* width, int* height) {
  const int longest = std::max(*width, *height);
  if (longest <= max_side) return;
  const double scale = static_cast<double>(max_side) / longest;
  *width = std::max(1, static_cast<int>(std::lround(*width * scale)));
  *height = std::max(1, static_cast<int>(std::lround(*height * scale)));
}

DecodingCost CostOfDecoding(const std::filesystem::path& file) {
  constexpr double kBytesPerPixel = 16;
  const std::optional<ImageSize> size = ReadHeaderSize(file);
  const double pixels = size ? std::min(kMaxPhotoPixels, 1.0 * size->width * size->height) : kMaxPhotoPixels;
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  return {static_cast<std::size_t>(kBytesPerPixel * pixels) + (error ? 0 : bytes), size.has_value()};
}

Photo DecodePhoto(std::string_view file, int max_side) {
  Photo photo;
  PhotoTags tags;
  Image stored = DecodeStored(file, &tags, &photo.notes);
  if (stored.channels == 4) {
    if (IsOpaque(stored)) {
      stored = WithoutAlpha(stored);
    } else {
      photo.notes.push_back("alpha channel kept");
    }
  }
  int width = stored.width, height = stored.height;
  FitWithin(max_side, &width, &height);
  // Resizing first leaves fewer pixels to turn.
  photo.image = ApplyOrientation(ResizeArea(stored, width, height), tags.orientation);
  photo.orientation = tags.orientation;
  photo.full_width = tags.orientation >= 5 ? stored.height : stored.width;
  photo.full_height = tags.orientation >= 5 ? stored.width : stored.height;
  photo.make = tags.make;
  photo.model = tags.model;
  if (const std::string profile = ForeignProfileName(tags.icc); !profile.empty()) {
    const bool is_converted = ConvertToSrgb(tags.icc, &photo.image);
    photo.notes.push_back(
        "colour profile '" + profile +
        (is_converted ? "': colours converted to sRGB" : "' ignored: colours are read as sRGB"));
  }
  if (const auto focal = FocalPixels(tags, width, height)) {
    const double per_side = *focal / std::max(width, height);
    if (per_side >= kMinFocalPerSide && per_side <= kMaxFocalPerSide) {
      photo.focal_px = focal;
    } else {
      photo.notes.push_back("EXIF focal length ignored: not plausible");
    }
  }
  return photo;
}

}  // namespace io
