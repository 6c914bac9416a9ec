#include "sfm/scene/doming.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "io/scene/decomposition.h"
#include "sfm/scene/pose_error.h"

namespace sfm {

double Doming(const std::vector<Eigen::Vector3d>& estimated, const std::vector<Eigen::Vector3d>& truth) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto truth_from_estimated = AlignCentres(estimated, truth);
  if (!truth_from_estimated || truth.size() < 4) return nan;
  const auto n = static_cast<Eigen::Index>(truth.size());
  Eigen::Matrix3Xd in_plane(3, n), error(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    in_plane.col(i) = truth[at];
    error.col(i) = *truth_from_estimated * estimated[at] - truth[at];
  }
  in_plane.colwise() -= in_plane.rowwise().mean().eval();
  const double extent = in_plane.colwise().norm().maxCoeff();
  const Eigen::Matrix3d scatter = in_plane * in_plane.transpose();
  const Eigen::Matrix3d axes =
      io::EigenDecomposition(scatter).vectors.rowwise().reverse();  // the normal is the last
  in_plane = axes.transpose() * in_plane / extent;
  cv::Mat terms(static_cast<int>(n), 4, CV_64F), heights(static_cast<int>(n), 1, CV_64F), fit;
  for (int i = 0; i < terms.rows; ++i) {
    const double x = in_plane(0, i), y = in_plane(1, i);
    const cv::Vec4d row(1, x, y, x * x + y * y);
    std::copy_n(row.val, 4, terms.ptr<double>(i));
    heights.at<double>(i) = axes.col(2).dot(error.col(i)) / extent;
  }
  cv::solve(terms, heights, fit, cv::DECOMP_SVD);  // points on a circle leave d open: the smallest is taken
  return std::abs(fit.at<double>(3));
}

}  // namespace sfm
