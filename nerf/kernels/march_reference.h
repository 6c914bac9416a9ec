// The plain reference of the march kernel: one ray, templated on the scalar.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "nerf/kernels/march.h"

namespace nerf::kernels::reference {

// Bound on |d u| / dt (maximum norm) of a ray of unit speed from a point at m = max |p_i| on, as a multiple
// of the speed in the inner cube. Outside it u_j = p_j (2 m - 1) / m^2, so that moving along j and against
// the largest axis gives
//   sqrt((2 m - 1)^2 + 4 (m - 1)^2) / m^2,
// which falls from m = 1.25 on, where it is sqrt(1.024); a ray on its way outwards only gets slower from
// there.
template <typename Scalar>
Scalar ContractedSpeed(Scalar m, bool outwards) {
  if (outwards && m > Scalar(1.25)) return std::sqrt((8 * m - 12) * m + 5) / (m * m);
  return std::sqrt(Scalar(1.024));
}

template <typename Scalar>
struct MarchedSample {
  Scalar t, delta, u[3];
  std::uint32_t cell;
};

// From *t on, which advances.
template <typename Scalar>
std::vector<MarchedSample<Scalar>> March(const OccupancyBlocks& blocks,
                                         const Scalar start[3],
                                         const Scalar slope[3],
                                         bool contracted,
                                         const MarchIntervals& intervals,
                                         Scalar t_last,
                                         std::size_t max_samples,
                                         Scalar* t) {
  const auto reach = [&](Scalar at) {
    Scalar m = 0;
    for (int i = 0; i < 3; ++i) m = std::max(m, std::abs(start[i] + at * slope[i]));
    return m;
  };
  std::vector<MarchedSample<Scalar>> samples;
  while (*t < t_last && samples.size() < max_samples) {
    MarchedSample<Scalar> sample;
    sample.delta = std::max(Scalar(intervals.step_size), Scalar(intervals.cone_angle) * *t);
    sample.t = *t + sample.delta / 2;
    Scalar length = Scalar(intervals.cell_length);
    const Scalar m = reach(sample.t);
    if (contracted) length /= ContractedSpeed(m, reach(sample.t + sample.delta) > m);
    std::uint32_t cell[3];
    for (int i = 0; i < 3; ++i) {
      const Scalar p = start[i] + sample.t * slope[i];
      const Scalar u = !contracted ? p : Scalar(0.5) + p / 4 * (m <= 1 ? 1 : (2 - 1 / m) / m);
      sample.u[i] = std::clamp(u, Scalar(0), Scalar(1));
      const auto index = static_cast<std::uint32_t>(sample.u[i] * static_cast<Scalar>(blocks.resolution));
      cell[i] = std::min(index, blocks.resolution - 1);
    }
    const std::uint32_t n = blocks.resolution, n_blocks = n / 4;
    const std::uint32_t block = (cell[2] / 4 * n_blocks + cell[1] / 4) * n_blocks + cell[0] / 4;
    const std::uint32_t bit = (cell[2] % 4 * 4 + cell[1] % 4) * 4 + cell[0] % 4;
    sample.cell = (cell[2] * n + cell[1]) * n + cell[0];
    const int distance = blocks.distance[block];
    if (distance == 0 && (blocks.cells[block] >> bit & 1) == 1) samples.push_back(sample);
    *t += distance > 1 ? std::max(sample.delta, static_cast<Scalar>(distance - 1) * length) : sample.delta;
  }
  return samples;
}

}  // namespace nerf::kernels::reference
