#include "sfm/bundle/reprojection_cost.h"

#include <cmath>

namespace sfm {
namespace {

// Below this angle [rad], the next terms of the series (angle^4 / 120 and smaller) are under the rounding of
// double.
constexpr double kSmallAngle = 1e-4;

// sin(a) / a, (1 - cos(a)) / a^2 and (a - sin(a)) / a^3.
struct RotationTerms {
  explicit RotationTerms(double angle) {
    const double a2 = angle * angle;
    if (angle < kSmallAngle) {
      sine = 1 - a2 / 6, cosine = 0.5 - a2 / 24, third = 1.0 / 6 - a2 / 120;
    } else {
      const double half = std::sin(angle / 2);
      sine = std::sin(angle) / angle, cosine = 2 * half * half / a2, third = (1 - sine) / a2;
    }
  }
  double sine, cosine, third;
};

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  return (Eigen::Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& w) {
  const RotationTerms terms(w.norm());
  const Eigen::Matrix3d cross = Cross(w);
  return Eigen::Matrix3d::Identity() + terms.cosine * cross + terms.third * cross * cross;
}

}  // namespace

double RobustLoss(double squared_error) {
  constexpr double kC2 = kRobustScalePx * kRobustScalePx;
  return kC2 * std::log1p(squared_error / kC2);
}

double RobustWeight(double squared_error) {
  return 1 / (1 + squared_error / (kRobustScalePx * kRobustScalePx));
}

Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& w) {
  const RotationTerms terms(w.norm());
  const Eigen::Matrix3d cross = Cross(w);
  return Eigen::Matrix3d::Identity() + terms.sine * cross + terms.cosine * cross * cross;
}

bool ReprojectionCost::Evaluate(double const* const* parameters,
                                double* residuals,
                                double** jacobians) const {
  using Matrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
  const Eigen::Map<const Eigen::Vector3d> w(parameters[0]), centre(parameters[0] + 3), point(parameters[1]);
  const double* lens = parameters[3];
  const double aspect = lens[kAspect - 1], cx = lens[kCx - 1], cy = lens[kCy - 1], k1 = lens[kK1 - 1],
               k2 = lens[kK2 - 1], p1 = lens[kP1 - 1], p2 = lens[kP2 - 1];
  const Eigen::Matrix3d rotation = RotationFromVector(w) * reference_rotation_;
  const Eigen::Vector3d x_cam = rotation * (point - centre);

  const Eigen::Vector3d seen = observer_from_cam_ * x_cam;
  const double depth = -seen.z(), u = seen.x() / depth, v = -seen.y() / depth;
  const double r2 = u * u + v * v, radial = 1 + r2 * (k1 + r2 * k2);
  const double du = u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u);
  const double dv = v * radial + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v;
  const double f = parameters[2][0] / sigma_, fl_x = f, fl_y = aspect * f, one = 1 / sigma_;
  residuals[0] = fl_x * du + one * (cx - xy_.x());
  residuals[1] = fl_y * dv + one * (cy - xy_.y());
  if (!jacobians) return true;

  if (jacobians[2]) {
    jacobians[2][0] = one * du;
    jacobians[2][1] = one * aspect * dv;
  }
  if (jacobians[3]) {
    Eigen::Map<Eigen::Matrix<double, 2, kLensIntrinsics, Eigen::RowMajor>> d_lens(jacobians[3]);
    d_lens << 0, one, 0, fl_x * u * r2, fl_x * u * r2 * r2, fl_x * 2 * u * v, fl_x * (r2 + 2 * u * u),  //
        f * dv, 0, one, fl_y * v * r2, fl_y * v * r2 * r2, fl_y * (r2 + 2 * v * v), fl_y * 2 * u * v;
  }
  // d radial / d u = d_radial * u, and the same for v.
  const double d_radial = 2 * (k1 + 2 * k2 * r2);
  const double mixed = u * v * d_radial + 2 * (p1 * u + p2 * v);
  Eigen::Matrix2d d_uv;
  d_uv << radial + u * u * d_radial + 2 * p1 * v + 6 * p2 * u, mixed, mixed,
      radial + v * v * d_radial + 2 * p2 * u + 6 * p1 * v;
  Matrix23 d_seen;  // d (u, v) / d seen, times depth
  d_seen << 1, 0, u, 0, -1, v;
  const Matrix23 d_cam =
      Eigen::Vector2d(fl_x, fl_y).asDiagonal() * d_uv * d_seen / depth * observer_from_cam_;
  const Matrix23 d_point = d_cam * rotation;
  if (jacobians[0]) {
    Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> d_pose(jacobians[0]);
    d_pose.leftCols<3>() = -d_cam * Cross(x_cam) * LeftJacobian(w);
    d_pose.rightCols<3>() = -d_point;
  }
  if (jacobians[1]) {
    Eigen::Map<Matrix23> map(jacobians[1]);
    map = d_point;
  }
  return true;
}

}  // namespace sfm
