#include "io/image/picture_measure.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>

namespace io {
namespace {

// Large enough to see a blur of two pixels in a 1600 px picture, small enough to ignore sensor noise.
constexpr int kSharpnessSide = 640;

// Averaged in float: the rounding noise of a resized 8-bit picture would pass for detail in a blurred one.
cv::Mat Grey(const Image& image, cv::Size size) {
  const cv::Mat colour(
      image.height, image.width, CV_8UC(image.channels), const_cast<std::uint8_t*>(image.data.data()));
  cv::Mat grey, real, small;
  cv::cvtColor(colour, grey, image.channels == 4 ? cv::COLOR_RGBA2GRAY : cv::COLOR_RGB2GRAY);
  grey.convertTo(real, CV_32F);
  cv::resize(real, small, size, 0, 0, cv::INTER_AREA);
  return small;
}

// Mean square of p(x + step) * ahead + p(x) * here + p(x - step) * behind.
double MeanSquare(const cv::Mat& p, cv::Point step, float ahead, float here, float behind) {
  cv::Mat kernel = cv::Mat::zeros(3, 3, CV_32F), m;
  const cv::Point centre(1, 1);
  kernel.at<float>(centre + step) = ahead;
  kernel.at<float>(centre) = here;
  kernel.at<float>(centre - step) = behind;
  cv::filter2D(p, m, CV_32F, kernel);
  return m.dot(m) / static_cast<double>(m.total());
}

}  // namespace

double Sharpness(const Image& image) {
  const double scale =
      std::min(1.0, static_cast<double>(kSharpnessSide) / std::max(image.width, image.height));
  const cv::Mat grey = Grey(image,
                            {std::max(3, static_cast<int>(image.width * scale)),
                             std::max(3, static_cast<int>(image.height * scale))});
  double sharpness = std::numeric_limits<double>::max();
  for (const cv::Point step : {cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1), cv::Point(1, -1)}) {
    const double second = MeanSquare(grey, step, 1, -2, 1), first = MeanSquare(grey, step, 0.5f, 0, -0.5f);
    sharpness = std::min(sharpness, second / (first + 1.0) / step.dot(step));
  }
  return sharpness;
}

Thumbnail MakeThumbnail(const Image& image) {
  Thumbnail thumbnail;
  cv::Mat target(32, 32, CV_8U, thumbnail.data());
  Grey(image, {32, 32}).convertTo(target, CV_8U);
  return thumbnail;
}

double Difference(const Thumbnail& a, const Thumbnail& b) {
  int sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

int LargestDifference(const Thumbnail& a, const Thumbnail& b) {
  int largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

double Brightness(const Thumbnail& thumbnail) {
  return std::accumulate(thumbnail.begin(), thumbnail.end(), 0.0) / static_cast<double>(thumbnail.size());
}

}  // namespace io
