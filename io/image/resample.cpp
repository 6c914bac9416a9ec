#include "io/image/resample.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "io/base/check.h"

namespace io {
namespace {

void ScaleColourByAlpha(cv::Mat* rgba, bool premultiply) {
  rgba->forEach<cv::Vec4f>([premultiply](cv::Vec4f& p, const int*) {
    const float alpha = p[3] / 255.f;
    const float factor = premultiply ? alpha : alpha > 0 ? 1 / alpha : 0.f;
    for (int c = 0; c < 3; ++c) p[c] *= factor;
  });
}

// OpenCV's coordinates: pixel centres at integers.
cv::Mat Coordinates(const std::vector<float>& of, const PixelSources& sources) {
  return cv::Mat(sources.height, sources.width, CV_32F, const_cast<float*>(of.data())) - 0.5f;
}

}  // namespace

Image Resample(const Image& image, const PixelSources& sources) {
  const int type = CV_8UC(image.channels);
  const cv::Mat source(image.height, image.width, type, const_cast<std::uint8_t*>(image.data.data()));
  const cv::Mat x = Coordinates(sources.x, sources), y = Coordinates(sources.y, sources);
  Image result = MakeImage(sources.width, sources.height, image.channels);
  cv::Mat target(result.height, result.width, type, result.data.data());
  if (image.channels == 3) {
    cv::remap(source, target, x, y, cv::INTER_LANCZOS4, cv::BORDER_REPLICATE);
  } else {
    cv::Mat premultiplied, resampled;
    source.convertTo(premultiplied, CV_32F);
    ScaleColourByAlpha(&premultiplied, true);
    cv::remap(premultiplied, resampled, x, y, cv::INTER_LANCZOS4, cv::BORDER_REPLICATE);
    ScaleColourByAlpha(&resampled, false);
    resampled.convertTo(target, CV_8U);
  }
  PIPELINE_CHECK(target.data == result.data.data());
  return result;
}

Mask Resample(const Mask& mask, const PixelSources& sources) {
  const cv::Mat source(mask.height, mask.width, CV_8U, const_cast<std::uint8_t*>(mask.used.data()));
  Mask result{sources.width, sources.height, std::vector<std::uint8_t>(sources.x.size())};
  cv::Mat target(result.height, result.width, CV_8U, result.used.data());
  cv::remap(source,
            target,
            Coordinates(sources.x, sources),
            Coordinates(sources.y, sources),
            cv::INTER_NEAREST,
            cv::BORDER_CONSTANT,
            0);
  PIPELINE_CHECK(target.data == result.used.data());
  return result;
}

}  // namespace io
