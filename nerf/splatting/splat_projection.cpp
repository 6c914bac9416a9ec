#include "nerf/splatting/splat_projection.h"

namespace nerf {
namespace {

using Eigen::Matrix2f;
using Eigen::Matrix3f;
using Eigen::Vector3f;
using Eigen::Vector4f;

constexpr float kH0 = static_cast<float>(kHarmonic0), kH1 = static_cast<float>(kHarmonic1);

// The harmonics of direction d by which the colours are multiplied.
Vector4f HarmonicsOf(const Vector3f& d) { return {kH0, -kH1 * d.y(), kH1 * d.z(), -kH1 * d.x()}; }

// Rotation of a unit quaternion w x y z.
Matrix3f RotationOf(const Vector4f& q) {
  return Eigen::Quaternionf(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

// d loss / d q for a unit quaternion q and g = d loss / d RotationOf(q).
Vector4f PullBackRotation(const Vector4f& q, const Matrix3f& g) {
  const float w = q[0], x = q[1], y = q[2], z = q[3];
  return 2 * Vector4f(x * (g(2, 1) - g(1, 2)) + y * (g(0, 2) - g(2, 0)) + z * (g(1, 0) - g(0, 1)),
                      w * (g(2, 1) - g(1, 2)) + y * (g(0, 1) + g(1, 0)) + z * (g(0, 2) + g(2, 0)) -
                          2 * x * (g(1, 1) + g(2, 2)),
                      w * (g(0, 2) - g(2, 0)) + x * (g(0, 1) + g(1, 0)) + z * (g(1, 2) + g(2, 1)) -
                          2 * y * (g(0, 0) + g(2, 2)),
                      w * (g(1, 0) - g(0, 1)) + x * (g(0, 2) + g(2, 0)) + y * (g(1, 2) + g(2, 1)) -
                          2 * z * (g(0, 0) + g(1, 1)));
}

// Standard deviations beyond which no splat has an alpha of 1 / 255, not even an opaque one: sqrt(2 ln 255).
constexpr float kMaxDeviations = 3.33f;

// Whether [middle - reach, middle + reach] misses [0, size].
bool Misses(float middle, float reach, float size) { return middle + reach < 0 || middle - reach > size; }

}  // namespace

// The columns of the Jacobian over a focal length f are (1 / z, -slope / z) at most, so that a deviation of
// at most s becomes at most f s sqrt(1 + slope^2) / z in the picture.
bool SplatCamera::IsBeside(const Eigen::Vector3f& in_cam, float largest_scale) const {
  const float inv_z = 1 / in_cam.z(), s = largest_scale * inv_z;
  const auto reach = [&](float fl, float max_slope) {
    const float variance = fl * fl * s * s * (1 + max_slope * max_slope) + low_pass;
    return kMaxDeviations * std::sqrt(variance);
  };
  return Misses(fl_x * in_cam.x() * inv_z + cx, reach(fl_x, slopes_x.Largest()), width) ||
         Misses(fl_y * in_cam.y() * inv_z + cy, reach(fl_y, slopes_y.Largest()), height);
}

SplatProjection::Matrix23f SplatProjection::Jacobian() const {
  const float z = in_cam_.z();
  const float slope_x = camera_->slopes_x.Clamp(in_cam_.x() / z);
  const float slope_y = camera_->slopes_y.Clamp(in_cam_.y() / z);
  Matrix23f jacobian;
  jacobian << camera_->fl_x / z, 0, -camera_->fl_x * slope_x / z,  //
      0, camera_->fl_y / z, -camera_->fl_y * slope_y / z;
  return jacobian;
}

bool SplatProjection::Project(const SplatCamera& camera, const Splats& splats, std::size_t index) {
  camera_ = &camera, splats_ = &splats;
  in_scene_ = Vector3f(&splats.places[3 * index]) - camera.centre;
  in_cam_ = camera.rotation * in_scene_;
  if (!(in_cam_.z() > static_cast<float>(kNearestSplat))) return false;
  const Vector3f log_scales(&splats.log_scales[3 * index]);
  if (camera.IsBeside(in_cam_, std::exp(log_scales.maxCoeff()))) return false;
  blended_.opacity = 1 / (1 + std::exp(-splats.opacities[index]));
  if (!(blended_.opacity > kernels::kMinSplatAlpha)) return false;

  scales_ = log_scales.array().exp();
  axes_ = RotationOf(Vector4f(&splats.rotations[4 * index]).normalized());
  picture_from_scene_ = Jacobian() * camera.rotation;
  picture_from_axes_ = picture_from_scene_ * axes_ * scales_.asDiagonal();
  const Matrix2f covariance =
      picture_from_axes_ * picture_from_axes_.transpose() + camera.low_pass * Matrix2f::Identity();
  const float determinant = covariance.determinant();  // >= low_pass^2 but for rounding
  blended_.x = camera.fl_x * in_cam_.x() / in_cam_.z() + camera.cx;
  blended_.y = camera.fl_y * in_cam_.y() / in_cam_.z() + camera.cy;
  blended_.a = covariance(1, 1) / determinant;
  blended_.b = -covariance(0, 1) / determinant;
  blended_.c = covariance(0, 0) / determinant;
  const Vector4f harmonics = HarmonicsOf(in_scene_.normalized());
  for (std::size_t c = 0; c < 3; ++c) {
    float value = 0.5f;
    for (int k = 0; k < kHarmonics; ++k)
      value += harmonics[k] * splats.colours[(index * kHarmonics + static_cast<std::size_t>(k)) * 3 + c];
    blended_.rgb[c] = std::max(0.f, value);
  }
  // opacity exp(-distance^2 / 2) = 1 / 255, in standard deviations.
  const float deviations = std::sqrt(2 * std::log(blended_.opacity / kernels::kMinSplatAlpha));
  blended_.reach_x = deviations * std::sqrt(covariance(0, 0));
  blended_.reach_y = deviations * std::sqrt(covariance(1, 1));
  return determinant > 0 && std::isfinite(blended_.reach_x + blended_.reach_y);
}

void SplatProjection::PullBack(const kernels::BlendedSplatGradient& from,
                               std::size_t index,
                               Splats* gradient) const {
  const SplatCamera& camera = *camera_;
  // The inverse covariance C: dC = -C dS C.
  Matrix2f inverse, by_inverse;
  inverse << blended_.a, blended_.b, blended_.b, blended_.c;
  by_inverse << from.a, 0.5f * from.b, 0.5f * from.b, from.c;
  const Matrix23f by_axes = -2 * (inverse * by_inverse * inverse) * picture_from_axes_;  // of (...)from_axes_
  const Matrix23f by_turned = by_axes * scales_.asDiagonal();
  const Matrix23f by_jacobian = by_turned * axes_.transpose() * camera.rotation.transpose();
  const Matrix3f by_rotation = picture_from_scene_.transpose() * by_turned;

  const float z = in_cam_.z(), slope_x = in_cam_.x() / z, slope_y = in_cam_.y() / z;
  const bool inside_x = camera.slopes_x.Holds(slope_x), inside_y = camera.slopes_y.Holds(slope_y);
  const Matrix23f jacobian = Jacobian();
  // Of x / z and y / z, which the middle and the Jacobian's last column are made of; then of z alone.
  const float by_slope_x = camera.fl_x * (from.x - (inside_x ? by_jacobian(0, 2) / z : 0));
  const float by_slope_y = camera.fl_y * (from.y - (inside_y ? by_jacobian(1, 2) / z : 0));
  Vector3f by_cam(by_slope_x / z, by_slope_y / z, 0);
  by_cam.z() = -(by_slope_x * slope_x + by_slope_y * slope_y + by_jacobian.cwiseProduct(jacobian).sum()) / z;
  Vector3f by_place = camera.rotation.transpose() * by_cam;

  const float distance = in_scene_.norm();
  const Vector3f direction = in_scene_ / distance;
  const Vector4f harmonics = HarmonicsOf(direction);
  Vector3f by_direction = Vector3f::Zero();
  for (std::size_t c = 0; c < 3; ++c) {
    const float by_colour = blended_.rgb[c] > 0 ? from.rgb[c] : 0;
    const float* k = &splats_->colours[index * kHarmonics * 3 + c];
    by_direction += kH1 * by_colour * Vector3f(-k[9], -k[3], k[6]);
    for (std::size_t i = 0; i < kHarmonics; ++i)
      gradient->colours[(index * kHarmonics + i) * 3 + c] = harmonics[static_cast<int>(i)] * by_colour;
  }
  by_place += (by_direction - direction * direction.dot(by_direction)) / distance;

  const Vector4f q(&splats_->rotations[4 * index]), unit = q.normalized();
  const Vector4f by_unit = PullBackRotation(unit, by_rotation);
  using Row3 = Eigen::Map<Vector3f>;
  Row3(&gradient->places[3 * index]) = by_place;
  Row3(&gradient->log_scales[3 * index]) = by_axes.cwiseProduct(picture_from_axes_).colwise().sum();
  Eigen::Map<Vector4f>(&gradient->rotations[4 * index]) = (by_unit - unit * unit.dot(by_unit)) / q.norm();
  gradient->opacities[index] = from.opacity * blended_.opacity * (1 - blended_.opacity);
}

}  // namespace nerf
