#include "nerf/paths/keyframe_path.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace nerf {
namespace {

// Weights of four neighbouring values at `t` in [0, 1] between the two middle ones (Catmull and Rom 1974).
std::array<double, 4> CatmullRom(double t) {
  const double t2 = t * t, t3 = t2 * t;
  return {(-t3 + 2 * t2 - t) / 2, (3 * t3 - 5 * t2 + 2) / 2, (-3 * t3 + 4 * t2 + t) / 2, (t3 - t2) / 2};
}

}  // namespace

std::vector<Keyframe> InterpolateKeyframes(std::span<const Keyframe> keyframes, int frames, bool is_loop) {
  const int n = static_cast<int>(keyframes.size());
  // Splines must not swing beyond the angles that were set.
  const auto [narrowest, widest] = std::minmax_element(
      keyframes.begin(), keyframes.end(), [](const auto& a, const auto& b) { return a.fov_y < b.fov_y; });
  const int segments = is_loop ? n : n - 1;
  std::vector<Keyframe> path;
  for (int frame = 0; frame < frames; ++frame) {
    const double place = static_cast<double>(segments) * frame / std::max(1, is_loop ? frames : frames - 1);
    const int segment = std::clamp(static_cast<int>(place), 0, std::max(0, segments - 1));
    const std::array<double, 4> weights = CatmullRom(place - segment);
    Keyframe mean;
    Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
    const auto at = [&](int index) -> const Keyframe& {
      index = is_loop ? (index + n) % n : std::clamp(index, 0, n - 1);
      return keyframes[static_cast<std::size_t>(index)];
    };
    const Eigen::Quaterniond middle(at(segment).world_from_cam.rotation);
    for (int k = 0; k < 4; ++k) {
      const Keyframe& key = at(segment - 1 + k);
      const double weight = weights[static_cast<std::size_t>(k)];
      const Eigen::Quaterniond q(key.world_from_cam.rotation);
      rotation += (q.dot(middle) < 0 ? -weight : weight) * q.coeffs();
      mean.world_from_cam.translation += weight * key.world_from_cam.translation;
      mean.fov_y += weight * key.fov_y;
    }
    mean.world_from_cam.rotation = Eigen::Quaterniond(rotation.normalized()).toRotationMatrix();
    mean.fov_y = std::clamp(mean.fov_y, narrowest->fov_y, widest->fov_y);
    path.push_back(mean);
  }
  return path;
}

io::Camera CameraOfView(int width, int height, double fov_y) {
  const double focal = 0.5 * height / std::tan(0.5 * fov_y);
  return {
      .width = width, .height = height, .fl_x = focal, .fl_y = focal, .cx = 0.5 * width, .cy = 0.5 * height};
}

}  // namespace nerf
