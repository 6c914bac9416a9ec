#include "io/scene/scene.h"

#include <fmt/format.h>

#include <algorithm>

namespace io {
namespace {

// See ImplausibleIntrinsics.
constexpr double kMinFocalPerSide = 0.1, kMaxFocalPerSide = 30, kPrincipalPointMargin = 1;  // pixel

// Newton on the distortion converges quadratically where it is monotone; 20 steps are far more than it needs
// there.
constexpr int kMaxUndistortIterations = 20;
// 1e-12 of the focal length is 1e-9 pixel, the accuracy promised for projection round trips.
constexpr double kUndistortTolerance = 1e-12;

// OpenCV's model on normalised coordinates (x right, y down), with its 2x2 Jacobian.
Eigen::Vector2d Distort(const Camera& camera, const Eigen::Vector2d& uv, Eigen::Matrix2d* jacobian) {
  const double u = uv.x(), v = uv.y(), r2 = u * u + v * v;
  const double radial = 1.0 + camera.k1 * r2 + camera.k2 * r2 * r2;
  if (jacobian) {
    const double d_radial = 2.0 * (camera.k1 + 2.0 * camera.k2 * r2);  // d radial / d u = d_radial * u
    (*jacobian)(0, 0) = radial + u * u * d_radial + 2.0 * camera.p1 * v + 6.0 * camera.p2 * u;
    (*jacobian)(0, 1) = u * v * d_radial + 2.0 * camera.p1 * u + 2.0 * camera.p2 * v;
    (*jacobian)(1, 0) = u * v * d_radial + 2.0 * camera.p2 * v + 2.0 * camera.p1 * u;
    (*jacobian)(1, 1) = radial + v * v * d_radial + 2.0 * camera.p2 * u + 6.0 * camera.p1 * v;
  }
  return {u * radial + 2.0 * camera.p1 * u * v + camera.p2 * (r2 + 2.0 * u * u),
          v * radial + camera.p1 * (r2 + 2.0 * v * v) + 2.0 * camera.p2 * u * v};
}

}  // namespace

std::string ImplausibleIntrinsics(const Camera& camera) {
  const double side = std::max(camera.width, camera.height);
  for (const double focal : {camera.fl_x, camera.fl_y}) {
    if (!(focal >= kMinFocalPerSide * side && focal <= kMaxFocalPerSide * side))
      return fmt::format(
          "a focal length of {:g} pixels for pictures of {}x{}: not {:g} to {:g} times the longer side",
          focal,
          camera.width,
          camera.height,
          kMinFocalPerSide,
          kMaxFocalPerSide);
  }
  const auto is_inside = [](double c, int pixels) {
    return c >= kPrincipalPointMargin && c <= pixels - kPrincipalPointMargin;
  };
  if (!is_inside(camera.cx, camera.width) || !is_inside(camera.cy, camera.height))
    return fmt::format("its principal point ({:g}, {:g}) on the edge of the picture, {}x{}, or outside",
                       camera.cx,
                       camera.cy,
                       camera.width,
                       camera.height);
  return "";
}

void RenumberObservers(const std::vector<int>& new_index, std::vector<Point3D>* points) {
  std::erase_if(*points, [&](Point3D& point) {
    if (point.frame_indices.empty()) return false;
    for (int& index : point.frame_indices) index = new_index[static_cast<std::size_t>(index)];
    std::erase(point.frame_indices, -1);
    return point.frame_indices.empty();
  });
}

std::optional<Eigen::Vector2d> ImgFromCam(const Camera& camera, const Eigen::Vector3d& x_in_cam) {
  const double depth = -x_in_cam.z();
  if (!(depth > 0)) return std::nullopt;
  const Eigen::Vector2d uv(x_in_cam.x() / depth, -x_in_cam.y() / depth);
  const Eigen::Vector2d d = Distort(camera, uv, nullptr);
  return Eigen::Vector2d(camera.fl_x * d.x() + camera.cx, camera.fl_y * d.y() + camera.cy);
}

std::optional<Eigen::Vector3d> RayFromImg(const Camera& camera, const Eigen::Vector2d& xy) {
  const Eigen::Vector2d distorted((xy.x() - camera.cx) / camera.fl_x, (xy.y() - camera.cy) / camera.fl_y);
  Eigen::Vector2d uv = distorted;
  if (camera.HasDistortion()) {
    bool converged = false;
    for (int i = 0; i < kMaxUndistortIterations && !converged; ++i) {
      Eigen::Matrix2d jacobian;
      const Eigen::Vector2d residual = Distort(camera, uv, &jacobian) - distorted;
      // Beyond the radius where the distortion folds back the determinant is not positive: no unique ray
      // there.
      if (!(jacobian.determinant() > 0)) return std::nullopt;
      uv -= jacobian.inverse() * residual;
      converged = residual.norm() < kUndistortTolerance;
    }
    if (!converged) return std::nullopt;
  }
  return Eigen::Vector3d(uv.x(), -uv.y(), -1.0).normalized();
}

Camera ResizedCamera(const Camera& camera, int width, int height) {
  const double sx = static_cast<double>(width) / camera.width,
               sy = static_cast<double>(height) / camera.height;
  Camera resized = camera;
  resized.width = width;
  resized.height = height;
  resized.fl_x *= sx;
  resized.cx *= sx;
  resized.fl_y *= sy;
  resized.cy *= sy;
  return resized;
}

}  // namespace io
