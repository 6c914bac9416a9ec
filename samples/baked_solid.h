// A solid with what is expensive about it worked out once on a grid over its bounding box: how far a ray may
// step, and how much light arrives. Light does not depend on the camera, so every photograph shares it.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "samples/solid.h"

namespace samples {

// Light that arrives at a surface point: share of the lamp that is seen, and openness to the room, both in
// [0, 1].
struct Light {
  double lamp = 1, ambient = 1;
};
using LightFunction = std::function<Light(const Vec3& p, const Vec3& normal)>;

class BakedSolid {
 public:
  BakedSolid(const Solid& solid, int threads);

  // Fills the light grid; call after all solids exist, since they shade each other.
  void BakeLight(const LightFunction& light, int threads);

  const Solid& solid() const { return solid_; }
  Light LightAt(const Vec3& p) const;
  Vec3 Normal(const Vec3& p) const;

  // Distance along the ray (unit direction) to the first surface point before t_max; nothing when there is
  // none.
  std::optional<double> Intersect(const Vec3& origin, const Vec3& direction, double t_max) const;

 private:
  std::size_t Index(int x, int y, int z) const;
  Vec3 Corner() const { return solid_.centre - Vec3::Constant(solid_.radius); }

  Solid solid_;
  double cell_ = 0;
  std::vector<float> distance_, lamp_, ambient_;
};

}  // namespace samples
