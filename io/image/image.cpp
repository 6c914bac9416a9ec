#include "io/image/image.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/image/media_type.h"
#include "io/image/opencv_encode.h"
#include "io/image/photo_codecs.h"

namespace io {
namespace {

cv::Mat ToMat(const Image& image) {
  return {image.height, image.width, CV_8UC(image.channels), const_cast<std::uint8_t*>(image.data.data())};
}

}  // namespace

Image MakeImage(int width, int height, int channels) {
  return {width,
          height,
          channels,
          std::vector<std::uint8_t>(static_cast<std::size_t>(std::ptrdiff_t{width} * height * channels))};
}

Image ReadImage(const std::filesystem::path& path) {
  const std::string file = ReadFile(path);
  std::vector<std::string> notes;
  try {
    return MediaTypeOf(file) == MediaType::kJpeg ? DecodeJpeg(file, &notes) : DecodeWithOpenCv(file, &notes);
  } catch (const Error& error) {
    throw Error(error.code(), path.string() + ": " + error.what());
  }
}

Image WithoutAlpha(const Image& image) {
  Image rgb = MakeImage(image.width, image.height, 3);
  cv::Mat target(image.height, image.width, CV_8UC3, rgb.data.data());
  cv::cvtColor(ToMat(image), target, cv::COLOR_RGBA2RGB);
  return rgb;
}

std::vector<std::uint8_t> EncodeImage(const Image& image, const char* extension) {
  cv::Mat bgr;
  cv::cvtColor(ToMat(image), bgr, image.channels == 4 ? cv::COLOR_RGBA2BGRA : cv::COLOR_RGB2BGR);
  // PNG as OpenCV writes it by default: against level 3, a tenth larger in 0.4 of the time.
  return EncodeWithOpenCv(extension, bgr, {cv::IMWRITE_JPEG_QUALITY, 95});
}

void WriteImage(const std::filesystem::path& path, const Image& image) {
  const std::vector<std::uint8_t> bytes = EncodeImage(image, path.extension().c_str());
  WriteFileAtomically(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

Image ResizeArea(const Image& image, int width, int height) {
  if (image.width == width && image.height == height) return image;
  const int n = image.channels;
  // Channel by channel: large photos in float are what takes most memory of all.
  const auto as_float = [&](int channel) {
    cv::Mat values;
    cv::extractChannel(ToMat(image), values, channel);
    values.convertTo(values, CV_32F, 1.0 / 255.0);
    return values;
  };
  const cv::Mat opacity = n == 4 ? as_float(3) : cv::Mat();
  cv::Mat resized(height, width, CV_32FC(n));
  for (int c = 0; c < n; ++c) {
    cv::Mat source = c == 3 ? opacity : as_float(c), part;
    if (n == 4 && c < 3) cv::multiply(source, opacity, source);
    cv::resize(source,
               part,
               cv::Size(width, height),
               0,
               0,
               width <= image.width ? cv::INTER_AREA : cv::INTER_LINEAR);
    cv::insertChannel(part, resized, c);
  }
  Image result = MakeImage(width, height, n);
  const float* in = resized.ptr<float>();
  for (std::size_t i = 0; i < result.data.size(); ++i) {
    const float alpha = n == 4 ? in[i / 4 * 4 + 3] : 1.f;
    const float value = n == 4 && i % 4 != 3 ? (alpha > 0 ? in[i] / alpha : 0.f) : in[i];
    result.data[i] = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.f, 1.f) * 255.f));
  }
  return result;
}

Image CompositeOn(const Image& image, std::uint8_t background) {
  if (image.channels == 3) return image;
  Image result = MakeImage(image.width, image.height, 3);
  for (std::size_t i = 0; i < result.data.size() / 3; ++i) {
    const double alpha = image.data[4 * i + 3] / 255.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = image.data[4 * i + c] * alpha + (1.0 - alpha) * background;
      result.data[3 * i + c] = static_cast<std::uint8_t>(std::lround(value));
    }
  }
  return result;
}

}  // namespace io
