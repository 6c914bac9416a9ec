#include "sfm/scene/doming.h"

#include <Eigen/QR>
#include <cmath>
#include <limits>

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
  Eigen::MatrixX4d terms(n, 4);
  terms.col(0).setOnes();
  terms.col(1) = in_plane.row(0).transpose();
  terms.col(2) = in_plane.row(1).transpose();
  terms.col(3) = in_plane.topRows<2>().colwise().squaredNorm().transpose();
  const Eigen::VectorXd heights = (axes.col(2).transpose() * error).transpose() / extent;
  const Eigen::Vector4d fit = terms.colPivHouseholderQr().solve(heights);
  return std::abs(fit[3]);
}

}  // namespace sfm
