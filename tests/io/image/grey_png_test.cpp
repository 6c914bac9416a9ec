// Grey PNG files of both depths come back as written.
#include "io/image/grey_png.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "tests/support/files/temp_dir.h"

namespace {

template <typename Value>
void ExpectRoundTrip(const std::vector<Value>& values, int type) {
  const TempDir dir;
  io::WriteGreyPng(dir / "a.png", 3, 2, std::span<const Value>(values));
  const cv::Mat read = cv::imread((dir / "a.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(read.type(), type);
  ASSERT_EQ(read.size(), cv::Size(3, 2));
  EXPECT_EQ(std::vector<Value>(read.begin<Value>(), read.end<Value>()), values);
}

TEST(GreyPng, EightAndSixteenBitsComeBack) {
  ExpectRoundTrip<std::uint8_t>({0, 1, 2, 127, 128, 255}, CV_8U);
  ExpectRoundTrip<std::uint16_t>({0, 1, 256, 32768, 65534, 65535}, CV_16U);
}

}  // namespace
