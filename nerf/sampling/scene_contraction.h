// Maps scene coordinates to the unit cube in which grid and hash tables live.
//
// Bounded scenes: the cube around the region of interest maps linearly. Unbounded scenes: with y = (x -
// centre) / half and m = max |y_i|, the inner cube m <= 1 maps linearly to the middle half, and everything
// outside by the contraction y (2 - 1/m) / m [Barron et al. 2022 with the maximum norm, as in Reiser et al.
// 2023], so that infinity lies on the faces. How fast it moves a ray: kernels/march_reference.h.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "io/scene/scene.h"

namespace nerf {

struct SceneContraction {
  std::array<float, 3> centre = {0, 0, 0};
  float half = 1;  // half side of the (inner) cube, scene units
  bool unbounded = false;

  static SceneContraction FromScene(const io::Scene& scene, bool unbounded) {
    const Eigen::Vector3d centre = 0.5 * (scene.aabb.min + scene.aabb.max);
    return {{static_cast<float>(centre.x()), static_cast<float>(centre.y()), static_cast<float>(centre.z())},
            static_cast<float>(0.5 * (scene.aabb.max - scene.aabb.min).maxCoeff()),
            unbounded};
  }

  // Side of the unit cube in scene units, measured at the centre.
  float InnerSide() const { return (unbounded ? 4.f : 2.f) * half; }

  // Distance of x from the centre in the maximum norm, in units of `half`.
  float Reach(const float x[3]) const {
    return std::max({std::fabs(x[0] - centre[0]), std::fabs(x[1] - centre[1]), std::fabs(x[2] - centre[2])}) /
           half;
  }

  void ToUnit(const float x[3], float unit[3]) const {
    const float m = Reach(x);
    const float scale = !unbounded ? 0.5f : m <= 1.f ? 0.25f : 0.25f * (2.f - 1.f / m) / m;
    for (int i = 0; i < 3; ++i) {
      unit[i] = std::clamp((x[i] - centre[static_cast<std::size_t>(i)]) / half * scale + 0.5f, 0.f, 1.f);
    }
  }

  // d loss / d x for given d loss / d unit, inside the cube: the transpose of ToUnit's Jacobian.
  void PullBack(const float x[3], const float unit_gradient[3], float x_gradient[3]) const {
    const float m = Reach(x);
    float scale = unbounded ? 0.25f : 0.5f, along = 0;  // along: d / dm of the contraction's factor
    int axis = 0;                                       // the one that m is measured on
    float y[3];
    for (int i = 0; i < 3; ++i) {
      y[i] = (x[i] - centre[static_cast<std::size_t>(i)]) / half;
      if (std::fabs(y[i]) == m) axis = i;
    }
    if (unbounded && m > 1.f) {
      scale = 0.25f * (2.f - 1.f / m) / m;
      along = 0.5f * (1.f / m - 1.f) / (m * m);
    }
    const float radial = y[0] * unit_gradient[0] + y[1] * unit_gradient[1] + y[2] * unit_gradient[2];
    for (int i = 0; i < 3; ++i) x_gradient[i] = scale * unit_gradient[i] / half;
    x_gradient[axis] += along * radial * (y[axis] > 0 ? 1.f : -1.f) / half;
  }

  // Where a ray ends, on the faces of the cube of an unbounded scene: the limit of ToUnit(origin + t
  // direction) for t -> infinity, the same for all origins.
  void ToUnitAtInfinity(const float direction[3], float unit[3]) const {
    const float m = std::max({std::fabs(direction[0]), std::fabs(direction[1]), std::fabs(direction[2])});
    for (int i = 0; i < 3; ++i) unit[i] = std::clamp(0.5f * direction[i] / m + 0.5f, 0.f, 1.f);
  }

  // d loss / d direction for given d loss / d unit there.
  static void PullBackAtInfinity(const float direction[3], const float unit_gradient[3], float gradient[3]) {
    int axis = 0;
    for (int i = 1; i < 3; ++i) {
      if (std::fabs(direction[i]) > std::fabs(direction[axis])) axis = i;
    }
    const float m = std::fabs(direction[axis]);
    float along = 0;
    for (int i = 0; i < 3; ++i) {
      gradient[i] = 0.5f * unit_gradient[i] / m;
      along -= 0.5f * direction[i] * unit_gradient[i] / (m * m);
    }
    gradient[axis] += direction[axis] > 0 ? along : -along;
  }

  // Inverse of ToUnit for points inside the open cube.
  void FromUnit(const float unit[3], float x[3]) const {
    float y[3], m = 0;
    for (int i = 0; i < 3; ++i) {
      y[i] = (unit[i] - 0.5f) * (unbounded ? 4.f : 2.f);
      m = std::max(m, std::fabs(y[i]));
    }
    const float scale = unbounded && m > 1.f ? 1.f / (m * (2.f - m)) : 1.f;
    for (int i = 0; i < 3; ++i) x[i] = y[i] * scale * half + centre[static_cast<std::size_t>(i)];
  }
};

}  // namespace nerf
