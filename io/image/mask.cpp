#include "io/image/mask.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <string>

#include "io/base/check.h"
#include "io/image/grey_png.h"

namespace io {
namespace {

constexpr int kUsed = 128;  // grey level from which a pixel is used, half of white

cv::Mat ToMat(const Mask& mask) {
  return {mask.height, mask.width, CV_8U, const_cast<std::uint8_t*>(mask.used.data())};
}

Mask Threshold(const cv::Mat& grey) {
  Mask mask{grey.cols, grey.rows, std::vector<std::uint8_t>(grey.total())};
  cv::Mat target = ToMat(mask);
  cv::threshold(grey, target, kUsed - 1, 255, cv::THRESH_BINARY);
  return mask;
}

}  // namespace

std::size_t Mask::UsedCount() const {
  return used.size() - static_cast<std::size_t>(std::count(used.begin(), used.end(), 0));
}

Mask MaskFromImage(const Image& image) {
  Image on_black = CompositeOn(image, 0);
  cv::Mat grey;
  cv::cvtColor(cv::Mat(image.height, image.width, CV_8UC3, on_black.data.data()), grey, cv::COLOR_RGB2GRAY);
  return Threshold(grey);
}

Mask ReadMask(const std::filesystem::path& path, int width, int height) {
  const Image image = ReadImage(path);
  if (image.width != width || image.height != height) {
    throw Error(ExitCode::kBadInput,
                fmt::format("{}: the mask is {}x{}, its picture {}x{}",
                            path.string(),
                            image.width,
                            image.height,
                            width,
                            height),
                "Give masks the size of their pictures");
  }
  Mask mask = MaskFromImage(image);
  if (mask.UsedCount() == 0)
    throw Error(ExitCode::kBadInput, path.string() + ": the mask uses no pixel", "Leave out its picture");
  return mask;
}

void WriteMask(const std::filesystem::path& path, const Mask& mask) {
  WriteGreyPng(path, mask.width, mask.height, std::span<const std::uint8_t>(mask.used));
}

Mask ShrinkMask(const Mask& mask, int width, int height) {
  PIPELINE_CHECK(width <= mask.width && height <= mask.height);
  if (width == mask.width && height == mask.height) return mask;
  cv::Mat resized;
  cv::resize(ToMat(mask), resized, cv::Size(width, height), 0, 0, cv::INTER_AREA);
  return Threshold(resized);
}

}  // namespace io
