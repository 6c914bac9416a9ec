// What bundle adjustment minimises: the distance between an observation and the projection of its point.
#pragma once

#include <ceres/ceres.h>

#include "sfm/bundle/intrinsics.h"

namespace sfm {

// A pose close to a reference rotation R0: x_cam = exp([w]x) R0 (X - C) with the rotation vector w first,
// then the centre C. Near w = 0 the chart has no singularity.
using PoseVector = Eigen::Matrix<double, 6, 1>;

// Observations this far off still count in full; beyond, their pull fades (mismatches). SIFT on a sharp
// picture is accurate to about half of it.
constexpr double kRobustScalePx = 1.0;

// Cauchy's loss rho(s) = c^2 log(1 + s / c^2) of the squared error s [px^2], with c = kRobustScalePx, and its
// derivative: the weight of the observation.
double RobustLoss(double squared_error);
double RobustWeight(double squared_error);

// residual = (ImgFromCam(camera, S x_cam) - xy) / sigma in pixels, camera axes and distortion as in
// io/scene/scene.h. Parameter blocks: pose (6), point (3), focal length (1), lens (7, Intrinsic from kAspect
// on). All Jacobians are analytic:
//   S: rotation from the camera whose pose it is to the one that observes, from the same place.
//   d x_cam / d w = -[x_cam]x J(w), J(w) = left Jacobian of SO(3) (Sola et al., "A micro Lie theory for state
//   estimation in robotics", 2018, equation 145);  d x_cam / d C = -R;  d x_cam / d X = R.
// A point behind the camera is projected through the centre, as in COLMAP: a trial step may pass there.
class ReprojectionCost final : public ceres::SizedCostFunction<2, 6, 3, 1, kLensIntrinsics> {
 public:
  ReprojectionCost(const Eigen::Vector2d& xy,
                   double sigma,
                   const Eigen::Matrix3d& reference_rotation,
                   const Eigen::Matrix3d& observer_from_cam = Eigen::Matrix3d::Identity())
      : xy_(xy),
        sigma_(sigma),
        reference_rotation_(reference_rotation),
        observer_from_cam_(observer_from_cam) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector2d xy_;
  double sigma_;
  Eigen::Matrix3d reference_rotation_, observer_from_cam_;
};

// exp([w]x).
Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& w);

}  // namespace sfm
