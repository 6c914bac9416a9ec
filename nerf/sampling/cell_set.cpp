#include "nerf/sampling/cell_set.h"

#include <cstddef>
#include <utility>

namespace nerf {

void Dilate(int resolution, CellSet* bits, CellSet* scratch) {
  const std::size_t row = static_cast<std::size_t>(resolution) / 64, n = static_cast<std::size_t>(resolution);
  const std::size_t plane = row * n;
  const std::uint64_t* in = bits->data();
  std::uint64_t* out = scratch->data();
  for (std::size_t r = 0; r < n * n; ++r) {
    for (std::size_t w = 0; w < row; ++w) {
      const std::uint64_t centre = in[r * row + w];
      const std::uint64_t before = w > 0 ? in[r * row + w - 1] >> 63 : 0;
      const std::uint64_t after = w + 1 < row ? in[r * row + w + 1] << 63 : 0;
      out[r * row + w] = centre | centre << 1 | centre >> 1 | before | after;
    }
  }
  const auto along = [&](const std::uint64_t* source,
                         std::uint64_t* target,
                         std::size_t stride,
                         std::size_t i,
                         std::size_t position) {
    target[i] =
        source[i] | (position > 0 ? source[i - stride] : 0) | (position + 1 < n ? source[i + stride] : 0);
  };
  for (std::size_t i = 0; i < plane * n; ++i) along(scratch->data(), bits->data(), row, i, i / row % n);
  for (std::size_t i = 0; i < plane * n; ++i) along(bits->data(), scratch->data(), plane, i, i / plane);
  std::swap(*bits, *scratch);
}

}  // namespace nerf
