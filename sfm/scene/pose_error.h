// How far estimated camera poses are from the truth. A reconstruction is free up to a similarity, so the two
// worlds are aligned first.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "io/scene/scene.h"

namespace sfm {

constexpr std::array<double, 4> kAucDegrees = {0.5, 1, 3, 5};

struct PoseError {
  int matched = 0;  // pictures with an estimated and a true pose
  // After one rotation of the world, fitted on the rotations; NaN when nothing matched.
  double rotation_median_deg = std::numeric_limits<double>::quiet_NaN(),
         rotation_max_deg = rotation_median_deg;
  // After AlignCentres, divided by the extent: the largest distance of a true centre from their mean. NaN
  // where the true centres do not fix a similarity, infinite where only the estimated ones do not.
  double centre_rmse = std::numeric_limits<double>::quiet_NaN(), centre_max = centre_rmse;
  double extent = std::numeric_limits<double>::quiet_NaN();  // in the truth's unit; set with centre_rmse
  // Area under the curve "share of all true pictures with at most this rotation error" up to kAucDegrees,
  // divided by it: the mean of max(0, 1 - error / limit), with 0 for a picture that has no estimated pose.
  std::array<double, 4> auc = {};
};

// The similarity that minimises sum |target_i - S source_i|^2: Umeyama, "Least-squares estimation of
// transformation parameters between two point patterns", PAMI 1991. Nothing for fewer than three points, and
// where either set is collinear or coincident: a rotation is then not determined.
std::optional<io::Sim3d> AlignCentres(const std::vector<Eigen::Vector3d>& source,
                                      const std::vector<Eigen::Vector3d>& target);

// Angle in degrees, in [0, 180], of the rotation between two orientations: with E = a^T b,
// atan2(|vee(E - E^T)|, tr E - 1), which unlike acos is exact to rounding at 0 and at 180.
double RotationErrorDeg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

// Pictures are the same when their file names are, without folder and extension.
PoseError ComparePoses(const io::Scene& estimated, const io::Scene& truth);

}  // namespace sfm
