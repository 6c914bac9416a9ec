// The whole scene: solids on a round table in a round room, lit by one large lamp. Answers what a ray sees.
#pragma once

#include <memory>
#include <vector>

#include "samples/baked_solid.h"
#include "samples/texture.h"

namespace samples {

struct StillLifeOptions {
  std::uint64_t seed = 1;  // of all paint
  bool blank = false;      // an empty room without texture
  // Texels of the paintings relative to a 960 pixel wide picture, where one texel is about one pixel.
  double detail = 1.0;
  int threads = 1;
};

class StillLife {
 public:
  explicit StillLife(const StillLifeOptions& options);

  // Linear radiance, 1 is white, arriving at `origin` (inside the room) from the unit `direction`.
  // pixel_angle: angle between neighbouring rays, radians, over which paint is averaged.
  Vec3 Radiance(const Vec3& origin, const Vec3& direction, double pixel_angle) const;

  // Distance to what the ray sees, scene units; always finite, the room is closed.
  double Depth(const Vec3& origin, const Vec3& direction) const;

 private:
  enum class Thing { kSolid, kTable, kTableSide, kFloor, kWall, kCeiling };
  struct Hit {
    Thing thing = Thing::kWall;
    double t = 0;
    const BakedSolid* solid = nullptr;
  };
  Hit Trace(const Vec3& origin, const Vec3& direction) const;
  Vec3 Shade(
      const Hit& hit, const Vec3& origin, const Vec3& direction, double pixel_angle, bool reflect) const;
  Vec3 ShadeSolid(
      const Hit& hit, const Vec3& origin, const Vec3& direction, double pixel_angle, bool reflect) const;
  Light ArrivingLight(const Vec3& p, const Vec3& normal) const;
  double LampVisibility(const Vec3& p) const;
  void PaintRoom(const StillLifeOptions& options);

  std::uint64_t seed_;
  bool blank_;
  std::vector<BakedSolid> solids_;
  std::unique_ptr<Texture> table_, floor_, wall_;  // with the light that falls on them
};

}  // namespace samples
