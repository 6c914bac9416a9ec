// The splats' share of the picture by the place of the surface that it shows: field and splats each have
// places where they are the better ones. Cells of the unit cube of the scene's contraction.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "nerf/sampling/ray.h"
#include "nerf/sampling/scene_contraction.h"

namespace nerf {

using UnitPlace = std::array<float, 3>;  // in the unit cube

// The surface that a ray meets at this distance; at infinity its direction decides, which in a bounded scene
// is no place.
std::optional<UnitPlace> PlaceOfSurface(const SceneContraction& contraction, const Ray& ray, float distance);

struct ShareMap {
  static constexpr std::size_t kResolution = 128;  // cells per axis
  static constexpr std::size_t kCells = kResolution * kResolution * kResolution;

  static std::size_t CellAt(const UnitPlace& place);

  bool empty() const { return cells.empty(); }
  // In [0, 1], linear between the middles of cells. The map must not be empty.
  float At(const UnitPlace& place) const;

  std::vector<std::uint8_t> cells;  // [kCells], shares in 255ths; or none: the same share everywhere
};

}  // namespace nerf
