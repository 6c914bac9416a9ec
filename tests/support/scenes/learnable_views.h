// Support for tests: nine small pictures around a point, with their poses, that a field can learn.
#pragma once

#include <cmath>
#include <filesystem>
#include <string>

#include "io/image/image.h"
#include "io/scene/transforms.h"
#include "tests/support/scenes/look_at.h"

namespace tests {

// Writes images/ and transforms.json. Every picture differs from the others.
inline void WriteLearnableViews(const std::filesystem::path& folder) {
  constexpr int kSide = 24, kViews = 9;
  io::Scene scene;
  scene.cameras = {{.width = kSide, .height = kSide, .fl_x = kSide, .fl_y = kSide, .cx = 12, .cy = 12}};
  for (int v = 0; v < kViews; ++v) {
    io::Image image = io::MakeImage(kSide, kSide, 3);
    for (std::size_t i = 0; i < image.data.size(); ++i)
      image.data[i] = static_cast<std::uint8_t>((i / 3 % kSide / 4 + i / 3 / kSide / 4) % 2 * 150 +
                                                10 * static_cast<std::size_t>(v) + i % 3 * 8);
    const std::filesystem::path path = folder / "images" / ("view" + std::to_string(v) + ".png");
    io::WriteImage(path, image);
    const double turn = 2 * EIGEN_PI * v / kViews;
    scene.frames.push_back({path,
                            0,
                            LookAt({4 * std::cos(turn), 4 * std::sin(turn), 1},
                                   Eigen::Vector3d::Zero(),
                                   Eigen::Vector3d::UnitZ())});
  }
  io::WriteTransforms(folder / "transforms.json", scene, "");
}

}  // namespace tests
