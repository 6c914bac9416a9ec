#include "io/image/colour_map.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "io/base/check.h"

namespace io {

Image ApplyColourMap(const std::vector<float>& values, int width, int height, ColourMap map) {
  Image image = MakeImage(width, height, 3);
  PIPELINE_CHECK_EQ(values.size() * 3, image.data.size());
  cv::Mat levels(height, width, CV_8U), bgr;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float value = std::isnan(values[i]) ? 0.f : std::clamp(values[i], 0.f, 1.f);
    levels.data[i] = static_cast<std::uint8_t>(std::lround(255 * value));
  }
  cv::applyColorMap(levels, bgr, map == ColourMap::kMagma ? cv::COLORMAP_MAGMA : cv::COLORMAP_TURBO);
  cv::Mat target(height, width, CV_8UC3, image.data.data());
  cv::cvtColor(bgr, target, cv::COLOR_BGR2RGB);
  return image;
}

}  // namespace io
