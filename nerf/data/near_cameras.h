// How near places lie to the training cameras, for a loss that decides where the pictures leave it open.
//
// What views show alike at any depth, black behind black or white behind white, may as well stand before a
// camera between them. It should go where it hides least. With the weights w_i (volume_rendering.h) of a
// ray's samples at x_i and the distance d to the nearest training camera,
//   L = sum_i w_i max(0, 1 - d(x_i) / reach)
// times a weight that is small but for the beginning, so that what the pictures tell outweighs it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/process/parallel.h"
#include "io/scene/scene.h"
#include "nerf/sampling/scene_contraction.h"

namespace nerf {

class NearCameras {
 public:
  // Cells per axis of the unit cube. In each, the camera that is nearest to its centre counts as the nearest:
  // at most the cell's diagonal too far.
  static constexpr int kSide = 32;

  // The cameras are those of the scene's frames.
  NearCameras(const io::Scene& scene, const SceneContraction& contraction, float reach, io::Workers* workers);

  // max(0, 1 - d / reach) at a finite place, of which `unit` is the position in the unit cube. It changes
  // steadily within a cell: were it constant there, nothing would pull at an opaque surface.
  float At(const std::array<float, 3>& unit, const std::array<float, 3>& place) const {
    const std::array<float, 3>& camera =
        cameras_[nearest_[(Index(unit[2]) * kSide + Index(unit[1])) * kSide + Index(unit[0])]];
    float distance2 = 0;
    for (std::size_t i = 0; i < 3; ++i) distance2 += (place[i] - camera[i]) * (place[i] - camera[i]);
    return std::max(0.f, 1 - std::sqrt(distance2) / reach_);
  }

 private:
  static std::size_t Index(float u) {
    return static_cast<std::size_t>(std::min(static_cast<int>(u * kSide), kSide - 1));
  }

  const float reach_;
  std::vector<std::array<float, 3>> cameras_;  // positions
  std::vector<std::uint32_t> nearest_;         // [z][y][x], into cameras_
};

}  // namespace nerf
