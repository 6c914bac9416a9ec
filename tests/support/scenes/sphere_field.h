// A field whose pictures are known in closed form, for tests of evaluation and film: a unit sphere at the
// origin with a chequered surface, before a grey background, or the one asked for in a crop box, which it
// fills.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>

#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace tests {

class SphereField : public nerf::TrainedField {
 public:
  // shade is added to every colour, so that two fields differ by a known error.
  explicit SphereField(float shade = 0) : shade_(shade) {}

  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& world_from_cam,
                            const nerf::RenderOptions& options) const override {
    {
      const std::lock_guard lock(mutex_);
      ++n_renders;
      last_options = options;
    }
    nerf::RenderedView view;
    view.width = camera.width;
    view.height = camera.height;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const Eigen::Vector3d ray = world_from_cam.rotation * *io::RayFromImg(camera, {x + 0.5, y + 0.5});
        const Eigen::Vector3d& origin = world_from_cam.translation;
        const double b = origin.dot(ray), discriminant = b * b - origin.squaredNorm() + 1;
        const double end = std::min<double>(6, options.limits.end);
        const bool reaches = discriminant > 0 && -b - std::sqrt(discriminant) < end;
        const double t = reaches ? -b - std::sqrt(discriminant) : end;
        const auto& crop = options.limits.crop;
        const bool hit = reaches && (!crop || nerf::Contains(*crop, origin + t * ray));
        const Eigen::Vector3d p = origin + t * ray;
        const bool dark =
            hit && (std::lround(5 * std::atan2(p.y(), p.x())) + std::lround(4 * p.z())) % 2 != 0;
        const float base = hit ? (dark ? 0.2f : 0.8f) : 0.55f;
        constexpr float kTints[] = {1.f, 0.8f, 0.6f};
        for (std::size_t c = 0; c < 3; ++c) {
          const float around = options.limits.crop ? options.background[c] : base + shade_;
          view.rgb.push_back(hit ? base * kTints[c] + shade_ : around);
        }
        view.depth.push_back(static_cast<float>(t));
        view.median_depth.push_back(hit ? static_cast<float>(t) : std::numeric_limits<float>::infinity());
        view.opacity.push_back(hit ? 1.f : 0.f);
      }
    }
    return view;
  }

  bool HasUnknownSpace() const override { return false; }
  std::array<float, 3> Background(const std::array<float, 3>&) const override {
    return {0.55f + shade_, 0.55f + shade_, 0.55f + shade_};
  }

  mutable int n_renders = 0;
  mutable nerf::RenderOptions last_options;

 private:
  float shade_;
  mutable std::mutex mutex_;  // of what is counted
};

// Cameras of width x height pixels on a ring of radius 4 around the z axis; the i-th is named names(i).
template <typename Names>
io::Scene RingScene(int n, int width, int height, const Names& names) {
  io::Scene scene;
  io::Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fl_x = camera.fl_y = 1.3 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  scene.cameras.push_back(camera);
  for (int i = 0; i < n; ++i) {
    const double a = 2 * std::numbers::pi * i / n;
    const Eigen::Vector3d back = Eigen::Vector3d(std::cos(a), std::sin(a), 0.5).normalized();
    const Eigen::Vector3d x = Eigen::Vector3d::UnitZ().cross(back).normalized();
    io::Frame frame;
    frame.image_path = names(i);
    frame.world_from_cam.rotation << x, back.cross(x), back;
    frame.world_from_cam.translation = 4 * back;
    scene.frames.push_back(frame);
  }
  scene.aabb = {Eigen::Vector3d::Constant(-1.2), Eigen::Vector3d::Constant(1.2)};
  return scene;
}

}  // namespace tests
