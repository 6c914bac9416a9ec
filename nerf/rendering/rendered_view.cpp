#include "nerf/rendering/rendered_view.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace nerf {
namespace {

std::vector<float> Resized(
    const std::vector<float>& values, const RenderedView& view, int width, int height, int how) {
  if (values.empty()) return {};
  const int channels = static_cast<int>(values.size()) / (view.width * view.height);
  std::vector<float> resized(static_cast<std::size_t>(width) * static_cast<std::size_t>(height * channels));
  const cv::Mat from(view.height, view.width, CV_32FC(channels), const_cast<float*>(values.data()));
  cv::Mat to(height, width, CV_32FC(channels), resized.data());
  cv::resize(from, to, to.size(), 0, 0, how);
  return resized;
}

}  // namespace

RenderedView Magnified(const RenderedView& view, int width, int height) {
  return {.width = width,
          .height = height,
          .rgb = Resized(view.rgb, view, width, height, cv::INTER_LINEAR),
          .depth = Resized(view.depth, view, width, height, cv::INTER_LINEAR),
          .opacity = Resized(view.opacity, view, width, height, cv::INTER_LINEAR),
          .median_depth = Resized(view.median_depth, view, width, height, cv::INTER_NEAREST_EXACT),
          .unlearnt = Resized(view.unlearnt, view, width, height, cv::INTER_LINEAR)};
}

}  // namespace nerf
