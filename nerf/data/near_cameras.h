// How near places lie to the training cameras, for a loss that decides where the pictures leave it open.
//
// What views show alike at any depth, black behind black or white behind white, may as well stand before a
// camera between them. It should go where it hides least. With the weights w_i (volume_rendering.h) of a
// ray's samples at x_i and the distance d to the nearest training camera,
//   L = sum_i w_i max(0, 1 - d(x_i) / reach)
// times a weight so small that anything the pictures tell outweighs it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "io/base/parallel.h"
#include "io/scene/scene.h"
#include "nerf/sampling/scene_contraction.h"

namespace nerf {

class NearCameras {
 public:
  // Cells per axis of the unit cube, in each of which the distance is that of its centre.
  static constexpr int kSide = 32;

  // The cameras are those of the scene's frames.
  NearCameras(const io::Scene& scene, const SceneContraction& contraction, float reach, io::Workers* workers);

  // max(0, 1 - d / reach) at a position in the unit cube.
  float At(float x, float y, float z) const {
    return nearness_[(Index(z) * kSide + Index(y)) * kSide + Index(x)];
  }

 private:
  static std::size_t Index(float u) {
    return static_cast<std::size_t>(std::min(static_cast<int>(u * kSide), kSide - 1));
  }

  std::vector<float> nearness_;  // [z][y][x]
};

}  // namespace nerf
