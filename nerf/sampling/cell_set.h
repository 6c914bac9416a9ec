// A set of the cells of a cubic grid: one bit per cell, in the order of OccupancyGrid's cells.
#pragma once

#include <cstdint>
#include <vector>

namespace nerf {

using CellSet = std::vector<std::uint64_t>;

inline CellSet EmptyCellSet(int resolution) {  // a multiple of 64 cells per axis
  const auto n = static_cast<std::size_t>(resolution);
  return CellSet(n * n * n / 64, 0);
}
inline void Insert(std::uint32_t cell, CellSet* set) { (*set)[cell / 64] |= std::uint64_t{1} << cell % 64; }

// Adds all neighbours of the cells, those across edges and corners too: one step in the maximum norm.
// *scratch has the same size; its content is lost.
void Dilate(int resolution, CellSet* set, CellSet* scratch);

}  // namespace nerf
