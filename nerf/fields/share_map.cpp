#include "nerf/fields/share_map.h"

#include <algorithm>
#include <cmath>

namespace nerf {
namespace {

constexpr int kSide = static_cast<int>(ShareMap::kResolution);

std::size_t CellOf(int x, int y, int z) { return static_cast<std::size_t>((x * kSide + y) * kSide + z); }

}  // namespace

std::optional<UnitPlace> PlaceOfSurface(const SceneContraction& contraction, const Ray& ray, float distance) {
  UnitPlace place;
  if (std::isfinite(distance)) {
    float x[3];
    for (int i = 0; i < 3; ++i) x[i] = ray.origin[i] + distance * ray.direction[i];
    contraction.ToUnit(x, place.data());
    return place;
  }
  if (!contraction.unbounded) return std::nullopt;
  contraction.ToUnitAtInfinity(ray.direction, place.data());
  return place;
}

std::size_t ShareMap::CellAt(const UnitPlace& place) {
  int cell[3];
  for (std::size_t i = 0; i < 3; ++i)
    cell[i] = std::clamp(static_cast<int>(place[i] * static_cast<float>(kSide)), 0, kSide - 1);
  return CellOf(cell[0], cell[1], cell[2]);
}

float ShareMap::At(const UnitPlace& place) const {
  int low[3], high[3];
  float toward_high[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const float middle = std::clamp(place[i] * static_cast<float>(kSide) - 0.5f, 0.f, kSide - 1.f);
    low[i] = static_cast<int>(middle);
    high[i] = std::min(low[i] + 1, kSide - 1);
    toward_high[i] = middle - static_cast<float>(low[i]);
  }
  float sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    float weight = 1;
    int cell[3];
    for (int i = 0; i < 3; ++i) {
      const bool is_high = (corner >> i & 1) != 0;
      cell[i] = is_high ? high[i] : low[i];
      weight *= is_high ? toward_high[i] : 1 - toward_high[i];
    }
    sum += weight * static_cast<float>(cells[CellOf(cell[0], cell[1], cell[2])]);
  }
  return sum / 255;
}

}  // namespace nerf
