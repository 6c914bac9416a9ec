#include "nerf/splatting/point_spacing.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/flann.hpp>

#include "io/process/interrupt.h"

namespace nerf {
namespace {

constexpr int kNeighbours = 8;
// Points looked up between two looks at whether the user wants to stop.
constexpr int kBatch = 1 << 14;

}  // namespace

std::vector<double> PointSpacing(const std::vector<Eigen::Vector3f>& points) {
  const int n = static_cast<int>(points.size()), k = std::min(kNeighbours, n - 1);
  std::vector<double> spacing(points.size());
  if (k < 1) return spacing;
  cv::Mat places(n, 3, CV_32F);
  for (int i = 0; i < n; ++i)
    Eigen::Map<Eigen::Vector3f>(places.ptr<float>(i)) = points[static_cast<std::size_t>(i)];
  cv::flann::GenericIndex<cvflann::L2_Simple<float>> tree(places, cvflann::KDTreeSingleIndexParams());
  for (int begin = 0; begin < n; begin += kBatch) {
    io::ThrowIfInterrupted();
    const cv::Mat batch = places.rowRange(begin, std::min(n, begin + kBatch));
    cv::Mat indices(batch.rows, k + 1, CV_32S), squares(batch.rows, k + 1, CV_32F);
    tree.knnSearch(batch, indices, squares, k + 1, cvflann::SearchParams());  // the point itself comes first
    for (int row = 0; row < batch.rows; ++row)
      spacing[static_cast<std::size_t>(begin + row)] =
          std::sqrt(static_cast<double>(squares.at<float>(row, k)) * std::numbers::pi / k);
  }
  return spacing;
}

}  // namespace nerf
