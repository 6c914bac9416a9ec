#include "io/image/grey_png.h"

#include <opencv2/core.hpp>
#include <string_view>
#include <vector>

#include "io/base/atomic_file.h"
#include "io/base/check.h"
#include "io/image/opencv_encode.h"

namespace io {
namespace {

void Write(const std::filesystem::path& path, const cv::Mat& grey) {
  const std::vector<std::uint8_t> bytes = EncodeWithOpenCv(".png", grey);
  WriteFileAtomically(path, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

template <typename Value>
cv::Mat ToMat(int width, int height, int type, std::span<const Value> values) {
  PIPELINE_CHECK_EQ(values.size(), static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  return {height, width, type, const_cast<Value*>(values.data())};
}

}  // namespace

void WriteGreyPng(const std::filesystem::path& path,
                  int width,
                  int height,
                  std::span<const std::uint8_t> values) {
  Write(path, ToMat(width, height, CV_8U, values));
}

void WriteGreyPng(const std::filesystem::path& path,
                  int width,
                  int height,
                  std::span<const std::uint16_t> values) {
  Write(path, ToMat(width, height, CV_16U, values));
}

}  // namespace io
