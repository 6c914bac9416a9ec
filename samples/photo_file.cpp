// JPEG through OpenCV, EXIF through Exiv2.
#include "samples/photo_file.h"

#include <fmt/format.h>

#include <cmath>
#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/base/atomic_file.h"
#include "io/base/check.h"

namespace samples {
namespace {

constexpr double kCropFactor = 6.0;  // of a small sensor, as in a telephone

Exiv2::ExifData ExifOf(const CameraTags& tags) {
  const int s = tags.taken_after_s;
  Exiv2::ExifData exif;
  exif["Exif.Image.Make"] = "Sample";
  exif["Exif.Image.Model"] = "Still life camera";
  exif["Exif.Photo.DateTimeOriginal"] =
      fmt::format("2024:05:04 {:02}:{:02}:{:02}", 10 + s / 3600, s / 60 % 60, s % 60);
  exif["Exif.Photo.ExposureTime"] =
      Exiv2::Rational(static_cast<int>(std::lround(1e6 * tags.exposure_s)), 1000000);
  exif["Exif.Photo.FocalLength"] =
      Exiv2::Rational(static_cast<int>(std::lround(100 * tags.focal_35mm / kCropFactor)), 100);
  exif["Exif.Photo.FocalLengthIn35mmFilm"] = static_cast<std::uint16_t>(std::lround(tags.focal_35mm));
  return exif;
}

}  // namespace

void WritePhoto(const std::filesystem::path& path,
                const io::Image& image,
                int quality,
                const CameraTags& tags) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3, const_cast<std::uint8_t*>(image.data.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> jpeg;
  const bool encoded = cv::imencode(".jpg", bgr, jpeg, {cv::IMWRITE_JPEG_QUALITY, quality});
  PIPELINE_CHECK(encoded);

  const auto file = Exiv2::ImageFactory::open(jpeg.data(), static_cast<long>(jpeg.size()));
  file->setExifData(ExifOf(tags));
  file->writeMetadata();
  Exiv2::BasicIo& bytes = file->io();
  bytes.open();
  const Exiv2::byte* begin = bytes.mmap();
  io::WriteFileAtomically(path, {reinterpret_cast<const char*>(begin), bytes.size()});
}

}  // namespace samples
