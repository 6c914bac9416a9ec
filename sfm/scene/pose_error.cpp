#include "sfm/scene/pose_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <string>

#include "io/base/median.h"
#include "io/scene/decomposition.h"

namespace sfm {
namespace {

// A similarity needs three points off a line.
constexpr int kMinCentres = 3;
// Width over length below which points count as collinear: the angle around the line is then known to no
// better than 1e6 times the relative error of the centres, which is 1e-6 at best for poses from pictures.
constexpr double kMinWidth = 1e-6;
// Width over the size of the coordinates below which it is rounding: 1e4 units in the last place.
constexpr double kMinWidthOverCoordinate = 1e-12;

Eigen::Matrix3Xd AsColumns(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Matrix3Xd columns(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return columns;
}

// The square roots of the eigenvalues of the scatter matrix, smallest first: thickness, width, length.
Eigen::Vector3d Sizes(const Eigen::Matrix3Xd& centred) {
  const Eigen::Matrix3d scatter = centred * centred.transpose();
  return io::EigenDecomposition(scatter).values.cwiseMax(0.0).cwiseSqrt();
}

bool FixesARotation(const Eigen::Matrix3Xd& points) {
  if (points.cols() < kMinCentres) return false;
  const Eigen::Matrix3Xd centred = points.colwise() - points.rowwise().mean();
  const Eigen::Vector3d sizes = Sizes(centred);
  return sizes[1] > kMinWidth * sizes[2] && sizes[1] > kMinWidthOverCoordinate * points.cwiseAbs().maxCoeff();
}

// argmin over rotations G of sum |G source_i - target_i|^2 (chordal mean).
Eigen::Matrix3d AlignRotations(const std::vector<Eigen::Matrix3d>& source,
                               const std::vector<Eigen::Matrix3d>& target) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < source.size(); ++i) sum += target[i] * source[i].transpose();
  return io::NearestRotation(sum);
}

void CompareCentres(const std::vector<Eigen::Vector3d>& estimated,
                    const std::vector<Eigen::Vector3d>& truth,
                    PoseError* error) {
  const Eigen::Matrix3Xd columns = AsColumns(truth);
  if (!FixesARotation(columns)) return;
  error->extent = (columns.colwise() - columns.rowwise().mean()).colwise().norm().maxCoeff();
  error->centre_rmse = error->centre_max = std::numeric_limits<double>::infinity();
  const auto truth_from_estimated = AlignCentres(estimated, truth);
  if (!truth_from_estimated) return;
  double sum = 0, largest = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double squared = (*truth_from_estimated * estimated[i] - truth[i]).squaredNorm();
    sum += squared;
    largest = std::max(largest, squared);
  }
  error->centre_rmse = std::sqrt(sum / static_cast<double>(truth.size())) / error->extent;
  error->centre_max = std::sqrt(largest) / error->extent;
}

}  // namespace

std::optional<io::Sim3d> AlignCentres(const std::vector<Eigen::Vector3d>& source,
                                      const std::vector<Eigen::Vector3d>& target) {
  if (source.size() != target.size()) return std::nullopt;
  const Eigen::Matrix3Xd a = AsColumns(source), b = AsColumns(target);
  if (!FixesARotation(a) || !FixesARotation(b)) return std::nullopt;
  // Umeyama, "Least-Squares Estimation of Transformation Parameters Between Two Point Patterns", PAMI 1991.
  const Eigen::Vector3d centre_a = a.rowwise().mean(), centre_b = b.rowwise().mean();
  const Eigen::Matrix3Xd from_a = a.colwise() - centre_a, from_b = b.colwise() - centre_b;
  const Eigen::Matrix3d covariance = from_b * from_a.transpose();
  io::Sim3d target_from_source;
  target_from_source.rotation = io::NearestRotation(covariance);
  target_from_source.scale =
      target_from_source.rotation.cwiseProduct(covariance).sum() / from_a.squaredNorm();
  target_from_source.translation =
      centre_b - target_from_source.scale * (target_from_source.rotation * centre_a);
  return target_from_source;
}

double RotationErrorDeg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const Eigen::Matrix3d e = a.transpose() * b;
  const Eigen::Vector3d vee(e(2, 1) - e(1, 2), e(0, 2) - e(2, 0), e(1, 0) - e(0, 1));
  return std::atan2(vee.norm(), e.trace() - 1) * 180 / std::numbers::pi;
}

PoseError ComparePoses(const io::Scene& estimated, const io::Scene& truth) {
  std::map<std::string, io::Rigid3d> estimated_pose;
  for (const io::Frame& frame : estimated.frames)
    estimated_pose[frame.image_path.stem().string()] = frame.world_from_cam;
  std::vector<Eigen::Matrix3d> rotations, true_rotations;
  std::vector<Eigen::Vector3d> centres, true_centres;
  for (const io::Frame& frame : truth.frames) {
    const auto pose = estimated_pose.find(frame.image_path.stem().string());
    if (pose == estimated_pose.end()) continue;
    rotations.push_back(pose->second.rotation);
    true_rotations.push_back(frame.world_from_cam.rotation);
    centres.push_back(pose->second.translation);
    true_centres.push_back(frame.world_from_cam.translation);
  }
  PoseError error;
  error.matched = static_cast<int>(rotations.size());
  if (rotations.empty()) return error;

  const Eigen::Matrix3d truth_from_estimated = AlignRotations(rotations, true_rotations);
  std::vector<double> errors;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    errors.push_back(RotationErrorDeg(truth_from_estimated * rotations[i], true_rotations[i]));
    for (std::size_t k = 0; k < kAucDegrees.size(); ++k)
      error.auc[k] +=
          std::max(0.0, 1 - errors.back() / kAucDegrees[k]) / static_cast<double>(truth.frames.size());
  }
  error.rotation_median_deg = io::MeanMedian(errors);
  error.rotation_max_deg = *std::max_element(errors.begin(), errors.end());
  CompareCentres(centres, true_centres, &error);
  return error;
}

}  // namespace sfm
