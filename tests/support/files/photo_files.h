// Small picture files for tests, and what becomes of them.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "io/base/error.h"
#include "io/image/photo.h"

namespace tests {

inline constexpr int kPhotoWidth = 48, kPhotoHeight = 32;

// A smooth gradient with a distinct colour in each corner, so that every flip and turn shows.
inline cv::Mat Picture(int type) {
  cv::Mat mat(kPhotoHeight, kPhotoWidth, CV_8UC3);
  mat.forEach<cv::Vec3b>([](cv::Vec3b& p, const int* at) {
    p = cv::Vec3b(static_cast<uchar>(40 + 2 * at[0]), static_cast<uchar>(30 + 4 * at[1]), 90);
  });
  cv::Mat result(kPhotoHeight, kPhotoWidth, CV_MAKETYPE(CV_8U, CV_MAT_CN(type)), cv::Scalar::all(200));
  for (int c = 0; c < std::min(3, result.channels()); ++c)
    cv::mixChannels(mat, result, std::array{c, c}.data(), 1);
  if (CV_MAT_DEPTH(type) == CV_16U) result.convertTo(result, CV_16U, 257.0);
  return result;
}

inline std::string Encode(const char* extension, const cv::Mat& mat, const std::vector<int>& options = {}) {
  std::vector<uchar> bytes;
  EXPECT_TRUE(cv::imencode(extension, mat, bytes, options));
  return {bytes.begin(), bytes.end()};
}

inline std::string ReasonFor(const std::string& file) {
  try {
    io::DecodePhoto(file, 1600);
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
    return error.what();
  }
  return "";
}

inline bool HasNote(const io::Photo& photo, const std::string& part) {
  for (const std::string& note : photo.notes) {
    if (note.find(part) != std::string::npos) return true;
  }
  return false;
}

// Largest channel difference to Picture(), which is BGR.
inline int ErrorAgainstPicture(const io::Image& image) {
  const cv::Mat mat = Picture(CV_8UC3);
  int worst = 0;
  for (int y = 0; y < kPhotoHeight; ++y) {
    for (int x = 0; x < kPhotoWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        worst = std::max(worst, std::abs(image.Pixel(x, y)[c] - mat.at<cv::Vec3b>(y, x)[2 - c]));
      }
    }
  }
  return worst;
}

}  // namespace tests
