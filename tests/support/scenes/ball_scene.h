// A small scene whose pictures are computed in closed form, for tests of training.
#pragma once

#include <cmath>
#include <filesystem>
#include <string>

#include "io/image/image.h"
#include "io/scene/scene.h"

namespace tests {

enum class Behind {
  kNothing,  // transparent
  kRoom,     // the painted walls of a cubic room of half side 5, far outside the region of interest
  kPaper,    // one colour
};

inline constexpr std::uint8_t kPaper[3] = {230, 240, 250};

// A ball of radius 0.8 at the origin with a smooth colour pattern.
inline void WriteBallView(const std::filesystem::path& path,
                          const io::Camera& camera,
                          const io::Rigid3d& pose,
                          Behind behind) {
  io::Image image = io::MakeImage(camera.width, camera.height, 4);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d d = pose.rotation * *io::RayFromImg(camera, {x + 0.5, y + 0.5}),
                            o = pose.translation;
      const double b = o.dot(d), discriminant = b * b - o.squaredNorm() + 0.64;
      std::uint8_t* p = image.Pixel(x, y);
      const bool hit = discriminant > 0;
      double wall = 1e9;
      for (int c = 0; c < 3; ++c) wall = std::min(wall, (std::copysign(5.0, d[c]) - o[c]) / d[c]);
      const Eigen::Vector3d at =
          hit ? Eigen::Vector3d((o + (-b - std::sqrt(discriminant)) * d) / 0.8) : o + wall * d;
      for (std::size_t c = 0; c < 3 && behind == Behind::kPaper; ++c) p[c] = kPaper[c];
      for (int c = 0; c < 3 && (hit || behind != Behind::kPaper); ++c)
        p[c] = static_cast<std::uint8_t>(
            std::lround(127.5 + 60 * std::sin(4 * at[c] + c) + 40 * std::sin(3 * at[(c + 1) % 3])));
      p[3] = hit || behind != Behind::kNothing ? 255 : 0;
    }
  }
  io::WriteImage(path, image);
}

struct BallSceneOptions {
  int size = 48;        // of the square pictures, in pixels
  double focal = 1.25;  // focal length per picture size: at 1.25 the ball covers a fifth of the picture
  Behind behind = Behind::kNothing;
};

// Views on a ring of radius 4 around the ball. `phase` in [0, 1) turns the ring by that share of a gap.
inline io::Scene BallScene(const std::filesystem::path& folder,
                           int n_views,
                           double phase,
                           const BallSceneOptions& options = {}) {
  io::Scene scene;
  scene.aabb = {Eigen::Vector3d::Constant(-1.2), Eigen::Vector3d::Constant(1.2)};
  const double focal = options.focal * options.size, centre_pixel = options.size / 2.;
  scene.cameras = {{.width = options.size,
                    .height = options.size,
                    .fl_x = focal,
                    .fl_y = focal,
                    .cx = centre_pixel,
                    .cy = centre_pixel}};
  for (int i = 0; i < n_views; ++i) {
    const double angle = 2 * M_PI * (i + phase) / n_views, height = 0.5 * std::sin(3 * angle);
    const Eigen::Vector3d centre = 4 * Eigen::Vector3d(std::cos(angle), std::sin(angle), height).normalized();
    io::Rigid3d pose;
    pose.translation = centre;
    pose.rotation.col(2) = centre.normalized();
    pose.rotation.col(0) = Eigen::Vector3d::UnitZ().cross(centre).normalized();
    pose.rotation.col(1) = pose.rotation.col(2).cross(pose.rotation.col(0));
    const std::filesystem::path path =
        folder / ("view_" + std::to_string(i) + "_" + std::to_string(phase > 0) + ".png");
    WriteBallView(path, scene.cameras[0], pose, options.behind);
    scene.frames.push_back({path, 0, pose});
  }
  return scene;
}

}  // namespace tests
