// The things that stand on the table. Lengths are in scene units: the figurine is 1.3 high, the table top is
// z = 0, z is up.
#pragma once

#include <cstdint>
#include <vector>

#include "samples/sdf.h"

namespace samples {

struct Surface {
  Vec3 albedo = Vec3::Zero();  // linear
  double gloss = 0;            // strength of the highlight, 0 ... 1
  double mirror = 0;           // reflectance at normal incidence (Fresnel F0) of the glaze; 0: matt
};

struct Solid {
  Vec3 centre = Vec3::Zero();  // bounding sphere
  double radius = 0;
  double (*distance)(const Vec3& p) = nullptr;  // signed, 1-Lipschitz
  Surface (*surface)(const Vec3& p,
                     const Vec3& normal,
                     std::uint64_t seed) = nullptr;  // paint at a surface point
};

// An owl with eyes, ears, scarf, carved feathers, and a wire antenna on its head (the thin part).
std::vector<Solid> FigurineSolids();

// Glazed vase (the glossy part) with twigs, bowl (the concave part) with fruit, books and letter cubes.
std::vector<Solid> TablewareSolids();

}  // namespace samples
