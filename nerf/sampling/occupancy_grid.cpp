#include "nerf/sampling/occupancy_grid.h"

#include <bit>

#include "io/base/check.h"
#include "nerf/sampling/cell_set.h"

namespace nerf {
OccupancyGrid::OccupancyGrid(int resolution, const SceneContraction& contraction)
    : resolution_(resolution), contraction_(contraction) {
  PIPELINE_CHECK_EQ(resolution % 64, 0);
  const std::size_t n = static_cast<std::size_t>(resolution);
  density_.assign(n * n * n, 0.f);
  distance_.assign(n * n * n, 1);
  Refresh();
}

void OccupancyGrid::Refresh() {
  const auto n = static_cast<std::uint32_t>(resolution_), blocks = n / kBlock;
  const std::size_t n_blocks = std::size_t{blocks} * blocks * blocks;
  block_distance_.assign(n_blocks + 3, kMaxDistance);  // OccupancyBlocks wants three more
  block_cells_.assign(n_blocks, 0);
  const std::uint8_t* distance = distance_.data();
  for (std::uint32_t z = 0; z < n; ++z) {
    for (std::uint32_t y = 0; y < n; ++y) {
      const std::uint32_t row = (z / kBlock * blocks + y / kBlock) * blocks;
      const std::uint32_t row_bit = (z % kBlock * kBlock + y % kBlock) * kBlock;
      for (std::uint32_t x = 0; x < n; ++x) {
        const std::uint8_t d = *distance++;
        std::uint8_t& least = block_distance_[row + x / kBlock];
        least = std::min(least, d);
        block_cells_[row + x / kBlock] |= std::uint64_t{d == 0} << (row_bit + x % kBlock);
      }
    }
  }
}

std::array<float, 3> OccupancyGrid::CellCentre(std::uint32_t cell) const {
  const auto n = static_cast<std::uint32_t>(resolution_);
  const auto centre = [n](std::uint32_t i) { return (static_cast<float>(i) + 0.5f) / static_cast<float>(n); };
  return {centre(cell % n), centre(cell / n % n), centre(cell / n / n)};
}

std::vector<std::uint32_t> OccupancyGrid::Candidates() const {
  std::vector<std::uint32_t> cells;
  for (std::uint32_t cell = 0; cell < density_.size(); ++cell) {
    if (!IsDeclaredEmpty(cell)) cells.push_back(cell);
  }
  return cells;
}

std::array<float, 6> OccupancyGrid::CandidateBox() const {
  std::array<float, 6> box = {1, 1, 1, 0, 0, 0};
  const float half = 0.5f / static_cast<float>(resolution_);
  for (const std::uint32_t cell : Candidates()) {
    const std::array<float, 3> centre = CellCentre(cell);
    for (std::size_t i = 0; i < 3; ++i)
      box[i] = std::min(box[i], centre[i] - half), box[i + 3] = std::max(box[i + 3], centre[i] + half);
  }
  return box;
}

float OccupancyGrid::Threshold(std::uint32_t cell) const {
  float size = contraction_.InnerSide() / static_cast<float>(resolution_);
  if (contraction_.unbounded) {
    // Contracted reach c = 2 - 1/m outside the inner cube; a cell there is m^2 = 1 / (2 - c)^2 times as deep.
    const std::array<float, 3> centre = CellCentre(cell);
    float c = 0;
    for (const float u : centre) c = std::max(c, std::fabs(u - 0.5f) * 4.f);
    if (c > 1.f) size /= (2.f - c) * (2.f - c);
  }
  return kMinOpacity / size;
}

void OccupancyGrid::Settle() {
  for (std::uint32_t cell = 0; cell < density_.size(); ++cell) {
    if (density_[cell] == kPresumedEmpty) {
      if (distance_[cell] < 2) density_[cell] = 0;
    } else if (distance_[cell] >= 2) {
      SetEmpty(cell);
    }
  }
}

double OccupancyGrid::OccupiedShare() const {
  const auto occupied = std::count(distance_.begin(), distance_.end(), std::uint8_t{0});
  return static_cast<double>(occupied) / static_cast<double>(distance_.size());
}

void OccupancyGrid::Rebuild(bool cautious) {
  double sum = 0, n_candidates = 0;
  for (const float density : density_) {
    sum += std::max(density, 0.f);
    n_candidates += density >= 0;
  }
  const float limit = cautious && n_candidates > 0 ? static_cast<float>(sum / n_candidates)
                                                   : std::numeric_limits<float>::infinity();
  const std::size_t words = density_.size() / 64;
  CellSet bits(words), seen(words), scratch(words);
  for (std::size_t w = 0; w < words; ++w) {
    std::uint64_t word = 0;
    for (std::size_t b = 0; b < 64; ++b) {
      const auto cell = static_cast<std::uint32_t>(64 * w + b);
      if (density_[cell] > 0 && density_[cell] > std::min(Threshold(cell), limit))
        word |= std::uint64_t{1} << b;
    }
    bits[w] = word;
  }
  std::fill(distance_.begin(), distance_.end(), static_cast<std::uint8_t>(kMaxDistance));
  for (int d = 0; d < kMaxDistance; ++d) {
    bool changed = false;
    for (std::size_t w = 0; w < words; ++w) {
      for (std::uint64_t fresh = bits[w] & ~seen[w]; fresh; fresh &= fresh - 1) {
        distance_[64 * w + static_cast<std::size_t>(std::countr_zero(fresh))] = static_cast<std::uint8_t>(d);
        changed = true;
      }
    }
    if (!changed) break;
    seen = bits;
    Dilate(resolution_, &bits, &scratch);
  }
  Refresh();
}

}  // namespace nerf
