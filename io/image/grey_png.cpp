#include "io/image/grey_png.h"

#include <opencv2/imgcodecs.hpp>
#include <string_view>
#include <vector>

#include "io/base/atomic_file.h"
#include "io/base/check.h"

namespace io {
namespace {

void Write(const std::filesystem::path& path, const cv::Mat& grey) {
  std::vector<std::uint8_t> bytes;
  PIPELINE_CHECK(cv::imencode(".png", grey, bytes));
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
