#include "io/image/photo_tags.h"

#include <algorithm>
#include <cmath>
#include <exiv2/exiv2.hpp>
#include <mutex>

namespace io {
namespace {

// Exiv2 keeps global state (XMP registry, log level).
std::mutex exiv2_mutex;

const Exiv2::Exifdatum* Find(const Exiv2::ExifData& exif, const char* key) {
  const auto it = exif.findKey(Exiv2::ExifKey(key));
  return it == exif.end() || it->count() == 0 ? nullptr : &*it;
}

double Number(const Exiv2::ExifData& exif, const char* key) {
  const Exiv2::Exifdatum* datum = Find(exif, key);
  return datum ? static_cast<double>(datum->toFloat()) : 0;
}

std::string Text(const Exiv2::ExifData& exif, const char* key) {
  const Exiv2::Exifdatum* datum = Find(exif, key);
  if (!datum) return "";
  std::string text = datum->toString().substr(0, 64);
  std::erase_if(text, [](char c) { return c < ' ' || c > '~'; });
  return text;
}

PhotoTags TagsOf(const Exiv2::ExifData& exif) {
  PhotoTags tags;
  const double orientation = Number(exif, "Exif.Image.Orientation");
  if (orientation >= 1 && orientation <= 8) tags.orientation = static_cast<int>(orientation);
  tags.make = Text(exif, "Exif.Image.Make");
  tags.model = Text(exif, "Exif.Image.Model");
  tags.focal_35mm = Number(exif, "Exif.Photo.FocalLengthIn35mmFilm");
  tags.focal_mm = Number(exif, "Exif.Photo.FocalLength");
  tags.pixel_x_dimension = Number(exif, "Exif.Photo.PixelXDimension");
  // FocalPlaneResolutionUnit: 2 inch (also the default), 3 cm, 4 mm.
  const double unit = Number(exif, "Exif.Photo.FocalPlaneResolutionUnit");
  const double mm_per_unit = unit == 3 ? 10 : unit == 4 ? 1 : 25.4;
  tags.pixels_per_mm = Number(exif, "Exif.Photo.FocalPlaneXResolution") / mm_per_unit;
  return tags;
}

}  // namespace

PhotoTags ReadPhotoTags(std::string_view file) {
  const std::lock_guard lock(exiv2_mutex);
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  try {
    const auto image = Exiv2::ImageFactory::open(reinterpret_cast<const Exiv2::byte*>(file.data()),
                                                 static_cast<long>(file.size()));
    try {
      image->readMetadata();
    } catch (const std::exception&) {
      // A damaged colour profile must not cost the orientation, which was read before it.
    }
    PhotoTags tags = TagsOf(image->exifData());
    if (const Exiv2::DataBuf* icc = image->iccProfile(); icc && icc->size_ > 0) {
      tags.icc.assign(reinterpret_cast<const char*>(icc->pData_), static_cast<std::size_t>(icc->size_));
    }
    return tags;
  } catch (const std::exception&) {
    return {};
  }
}

PhotoTags ParseExif(std::string_view exif) {
  const std::lock_guard lock(exiv2_mutex);
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  try {
    Exiv2::ExifData data;
    Exiv2::ExifParser::decode(
        data, reinterpret_cast<const Exiv2::byte*>(exif.data()), static_cast<std::uint32_t>(exif.size()));
    return TagsOf(data);
  } catch (const std::exception&) {
    return {};
  }
}

std::optional<double> FocalPixels(const PhotoTags& tags, int width, int height) {
  if (tags.focal_35mm != 0) return tags.focal_35mm * std::hypot(width, height) / std::hypot(36.0, 24.0);
  if (tags.focal_mm != 0 && tags.pixels_per_mm != 0 && tags.pixel_x_dimension > 0) {
    return tags.focal_mm * tags.pixels_per_mm * std::max(width, height) / tags.pixel_x_dimension;
  }
  return std::nullopt;
}

}  // namespace io
