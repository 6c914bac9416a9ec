#include "nerf/splatting/plain_rasteriser.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "nerf/kernels/splats_reference.h"

namespace nerf {
namespace {

using Eigen::Vector3d;

struct Seen {
  double depth;
  kernels::BlendedSplatOf<double> blended;
};

// Zwicker et al. 2002: the covariance J W C W^T J^T at the splat's middle.
Seen Project(const Splats& splats, std::size_t i, const SplatView& view) {
  const io::Camera& camera = view.camera;
  const io::Rigid3d cam_from_world = io::FlipCameraAxes(view.world_from_cam).Inverse();
  const Vector3d place = Eigen::Map<const Eigen::Vector3f>(&splats.places[3 * i]).cast<double>(),
                 p = cam_from_world * place;
  const Vector3d sigma =
      Eigen::Map<const Eigen::Vector3f>(&splats.log_scales[3 * i]).cast<double>().array().exp();
  const float* q = &splats.rotations[4 * i];
  const Eigen::Quaterniond turn = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
  const double margin = kSlopeMargin * camera.width;
  const double slope_x = std::clamp(p.x() / p.z(),
                                    (-camera.cx - margin) / camera.fl_x,
                                    (camera.width - camera.cx + margin) / camera.fl_x),
               slope_y = std::clamp(p.y() / p.z(),
                                    (-camera.cy - margin) / camera.fl_y,
                                    (camera.height - camera.cy + margin) / camera.fl_y);
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << camera.fl_x / p.z(), 0, -camera.fl_x * slope_x / p.z(),  //
      0, camera.fl_y / p.z(), -camera.fl_y * slope_y / p.z();
  const Eigen::Matrix<double, 2, 3> axes =
      jacobian * cam_from_world.rotation * turn.toRotationMatrix() * sigma.asDiagonal();
  const Eigen::Matrix2d covariance = axes * axes.transpose() + view.low_pass * Eigen::Matrix2d::Identity(),
                        precision = covariance.inverse();
  Seen seen{p.z(), {}};
  seen.blended.x = camera.fl_x * p.x() / p.z() + camera.cx;
  seen.blended.y = camera.fl_y * p.y() / p.z() + camera.cy;
  seen.blended.a = precision(0, 0), seen.blended.b = precision(0, 1), seen.blended.c = precision(1, 1);
  seen.blended.opacity = 1 / (1 + std::exp(-static_cast<double>(splats.opacities[i])));
  const Vector3d d = (place - view.world_from_cam.translation).normalized();
  const double harmonics[kHarmonics] = {
      kHarmonic0, -kHarmonic1 * d.y(), kHarmonic1 * d.z(), -kHarmonic1 * d.x()};
  for (std::size_t c = 0; c < 3; ++c) {
    double value = 0.5;
    for (std::size_t k = 0; k < kHarmonics; ++k)
      value += harmonics[k] * static_cast<double>(splats.colours[(i * kHarmonics + k) * 3 + c]);
    seen.blended.rgb[c] = std::max(0.0, value);
  }
  constexpr double kReach = 3.4;  // standard deviations beyond which no alpha reaches 1 / 255
  seen.blended.reach_x = kReach * std::sqrt(covariance(0, 0));
  seen.blended.reach_y = kReach * std::sqrt(covariance(1, 1));
  return seen;
}

// The pixels [begin, end) of n whose centres may lie within `reach` of `middle`.
std::pair<int, int> Reached(double middle, double reach, int n) {
  const auto pixel = [n](double place) { return static_cast<int>(std::clamp(place, 0.0, 1.0 * n)); };
  return {pixel(std::floor(middle - reach)), pixel(std::ceil(middle + reach))};
}

}  // namespace

std::vector<double> RenderPlainly(const Splats& splats,
                                  const SplatView& view,
                                  const std::array<double, 3>& background) {
  const io::Camera& camera = view.camera;
  std::vector<Seen> order;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const Seen seen = Project(splats, i, view);
    if (seen.depth > kNearestSplat) order.push_back(seen);
  }
  std::stable_sort(
      order.begin(), order.end(), [](const Seen& a, const Seen& b) { return a.depth < b.depth; });
  const auto n = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  std::vector<double> rgb(3 * n), transmittance(n, 1);
  for (const Seen& seen : order) {
    const auto [x_begin, x_end] = Reached(seen.blended.x, seen.blended.reach_x, camera.width);
    const auto [y_begin, y_end] = Reached(seen.blended.y, seen.blended.reach_y, camera.height);
    for (int y = y_begin; y < y_end; ++y) {
      for (int x = x_begin; x < x_end; ++x) {
        const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) +
                           static_cast<std::size_t>(x);
        kernels::reference::BlendSplat(seen.blended, x, y, &rgb[3 * pixel], &transmittance[pixel]);
      }
    }
  }
  for (std::size_t i = 0; i < 3 * n; ++i) rgb[i] += transmittance[i / 3] * background[i % 3];
  return rgb;
}

}  // namespace nerf
