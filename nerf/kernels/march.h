// What the march kernel works on: rays through the blocks of an occupancy grid.
#pragma once

#include <cstdint>

namespace nerf::kernels {

// Cells of the unit cube in blocks of 4 x 4 x 4, x fastest, blocks likewise.
struct OccupancyBlocks {
  std::uint32_t resolution = 0;            // cells per axis
  const std::uint8_t* distance = nullptr;  // per block: 0, or no cell nearer than this many is occupied;
                                           // three more bytes must be readable behind the last
  const std::uint64_t* cells = nullptr;    // per block: a bit for each occupied cell
};

// Rays p(t) = start + t slope. Bounded: p are unit coordinates u. Contracted: with m = max |p_i|, u = 1/2 +
// p / 4 for m <= 1 and 1/2 + (2 - 1/m) p / (4 m) outside.
struct MarchPaths {
  const float *start[3], *slope[3];  // [n]
  const float* t_last;               // [n] where rays end
  bool contracted = false;
};

// An interval from t on has length max(step_size, cone_angle t).
struct MarchIntervals {
  float step_size = 0, cone_angle = 0;
  float cell_length = 0;  // distance along a ray within which u moves by one cell at most, in the inner cube
};

// Per ray max_samples slots: the middle of each interval in an occupied cell, its length, u, and the cell.
struct MarchSlots {
  float *t, *delta, *x, *y, *z;
  std::uint32_t* cell;
};

// Marches n rays from t[i] on, to t_last or until max_samples samples are found, and leaves t[i] there:
// intervals in occupied cells become samples, empty ones are crossed one by one or, where a block says that
// its surroundings are empty, in jumps that pass no occupied cell. Ray i has the slots from i * max_samples
// on, of which count[i] are filled.
using MarchFunction = void (*)(const OccupancyBlocks& blocks,
                               const MarchPaths& paths,
                               const MarchIntervals& intervals,
                               int n,
                               int max_samples,
                               float* t,
                               int* count,
                               const MarchSlots& slots);

}  // namespace nerf::kernels
