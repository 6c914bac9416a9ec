// Support for tests: renders a splat file as the readers of 3D Gaussian Splatting do (Kerbl et al. 2023;
// projection after Zwicker et al. 2001), slowly and from the file alone, so that order and conventions are
// checked.
#pragma once

#include <algorithm>
#include <numeric>

#include "tests/support/sphere_export.h"

namespace tests {

inline constexpr double kLowPass_px2 =
    0.3;  // the variance that the reference implementation adds in the picture

inline nerf::RenderedView RenderSplats(const std::filesystem::path& file,
                                       const io::Camera& camera,
                                       const io::Rigid3d& world_from_cam) {
  auto columns = PlyColumns(file);
  const auto n = columns["x"].size();
  const auto vector = [&](const char* a, const char* b, const char* c, std::size_t i) {
    return Eigen::Vector3d(columns[a][i], columns[b][i], columns[c][i]);
  };
  // OpenCV axes, z forward.
  const io::Rigid3d cam_from_world = io::FlipCameraAxes(world_from_cam).Inverse();
  std::vector<Eigen::Vector3d> places;
  for (std::size_t i = 0; i < n; ++i) places.push_back(cam_from_world * vector("x", "y", "z", i));
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return places[a].z() < places[b].z(); });

  const auto n_pixels = static_cast<std::size_t>(camera.width * camera.height);
  nerf::RenderedView view{camera.width, camera.height, std::vector<float>(3 * n_pixels), {}, {}};
  std::vector<double> transmittance(n_pixels, 1);
  for (const std::size_t i : order) {
    const Eigen::Vector3d& p = places[i];
    if (p.z() < 0.1) continue;
    const Eigen::Quaterniond turn(
        columns["rot_0"][i], columns["rot_1"][i], columns["rot_2"][i], columns["rot_3"][i]);
    const Eigen::Vector3d sigma = vector("scale_0", "scale_1", "scale_2", i).array().exp();
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian << camera.fl_x / p.z(), 0, -camera.fl_x * p.x() / (p.z() * p.z()), 0, camera.fl_y / p.z(),
        -camera.fl_y * p.y() / (p.z() * p.z());
    const Eigen::Matrix<double, 2, 3> picture_from_axes =
        jacobian * cam_from_world.rotation * turn.toRotationMatrix() * sigma.asDiagonal();
    const Eigen::Matrix2d covariance =
        picture_from_axes * picture_from_axes.transpose() + kLowPass_px2 * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d precision = covariance.inverse();
    const Eigen::Vector2d centre(camera.fl_x * p.x() / p.z() + camera.cx,
                                 camera.fl_y * p.y() / p.z() + camera.cy);
    const Eigen::Vector3d rgb =
        (0.28209479177387814 * vector("f_dc_0", "f_dc_1", "f_dc_2", i).array() + 0.5).max(0);
    const double opacity = 1 / (1 + std::exp(-columns["opacity"][i]));
    const Eigen::Vector2d reach = 3 * covariance.diagonal().cwiseSqrt();
    const int x0 = std::max(0, static_cast<int>(centre.x() - reach.x())),
              x1 = std::min(camera.width - 1, static_cast<int>(centre.x() + reach.x())),
              y0 = std::max(0, static_cast<int>(centre.y() - reach.y())),
              y1 = std::min(camera.height - 1, static_cast<int>(centre.y() + reach.y()));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const auto pixel = static_cast<std::size_t>(y * camera.width + x);
        const Eigen::Vector2d offset = Eigen::Vector2d(x + 0.5, y + 0.5) - centre;
        const double alpha = std::min(0.99, opacity * std::exp(-0.5 * offset.dot(precision * offset)));
        for (std::size_t c = 0; c < 3; ++c)
          view.rgb[3 * pixel + c] +=
              static_cast<float>(transmittance[pixel] * alpha * rgb[static_cast<int>(c)]);
        transmittance[pixel] *= 1 - alpha;
      }
    }
  }
  for (const double t : transmittance) view.opacity.push_back(static_cast<float>(1 - t));
  return view;
}

}  // namespace tests
