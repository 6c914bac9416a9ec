// Which parts of the unit cube are worth sampling: a grid of densities with decay, and for every empty cell
// the distance to the nearest occupied one, so that a ray can cross empty space in one jump that never passes
// a sample.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "nerf/kernels/march.h"
#include "nerf/sampling/scene_contraction.h"

namespace nerf {

class OccupancyGrid {
 public:
  // A cell counts as occupied when crossing it absorbs more than this share of the light.
  static constexpr float kMinOpacity = 0.03f;
  // Each visit by a training sample lets the remembered density decay by 5 %. A cell starts at 3 times the
  // threshold, so it is dropped after about 22 visits that found no density.
  static constexpr float kDecay = 0.95f;
  static constexpr float kInitialFactor = 3.f;
  static constexpr float kProbeDecay = 0.8f;

  OccupancyGrid() = default;
  // resolution: cells per axis, a multiple of 64.
  OccupancyGrid(int resolution, const SceneContraction& contraction);

  int resolution() const { return resolution_; }
  std::size_t n_cells() const { return density_.size(); }
  std::uint32_t CellAt(const float unit[3]) const {
    const auto index = [this](float u) {
      return static_cast<std::uint32_t>(
          std::min(static_cast<int>(u * static_cast<float>(resolution_)), resolution_ - 1));
    };
    const auto n = static_cast<std::uint32_t>(resolution_);
    return (index(unit[2]) * n + index(unit[1])) * n + index(unit[0]);
  }
  // Centre of a cell in unit coordinates.
  std::array<float, 3> CellCentre(std::uint32_t cell) const;

  // 0: occupied; d > 0: every cell closer than d cells (maximum norm) is empty.
  std::uint8_t Distance(std::uint32_t cell) const { return distance_[cell]; }
  // The same for rays, in arrays that stay in the first-level caches.
  kernels::OccupancyBlocks Blocks() const {
    return {static_cast<std::uint32_t>(resolution_), block_distance_.data(), block_cells_.data()};
  }

  // A training sample saw density sigma in the cell.
  void Visit(std::uint32_t cell, float sigma) { density_[cell] = std::max(density_[cell] * kDecay, sigma); }
  // The density at a random point of the cell, whether or not training rays visit it: so density can come
  // back, and fog that no ray meets disappears. Five probes of 0 take a cell from its initial density below
  // the threshold.
  void Probe(std::uint32_t cell, float sigma) {
    density_[cell] = std::max(density_[cell] * kProbeDecay, sigma);
  }

  // Declares a cell empty for good; empty until space settles (Settle), unless it is empty for good already;
  // or possibly occupied (with the initial density).
  void SetEmpty(std::uint32_t cell) { density_[cell] = kEmpty; }
  void PresumeEmpty(std::uint32_t cell) {
    if (density_[cell] >= 0) density_[cell] = kPresumedEmpty;
  }
  // Cells that are not declared empty, in order.
  std::vector<std::uint32_t> Candidates() const;
  // The smallest box that holds them, in unit coordinates: min x, y, z, max x, y, z; min above max without
  // any.
  std::array<float, 6> CandidateBox() const;
  void SetCandidate(std::uint32_t cell) { density_[cell] = kInitialFactor * Threshold(cell); }
  bool IsDeclaredEmpty(std::uint32_t cell) const { return density_[cell] < 0; }

  // Declares all cells empty for good that touch no occupied one, as of the last Rebuild, but for those that
  // are presumed empty: they stay so until they touch one, and are candidates from then on.
  void Settle();

  // Sets the density of all candidates to 0.
  void Forget() {
    for (float& density : density_) density = std::min(density, 0.f);
  }

  // Recomputes distances from densities. cautious: a cell also counts as occupied when it is denser than the
  // mean of the candidates, so that a field that is still thin everywhere is not dropped [as instant-ngp].
  void Rebuild(bool cautious = false);
  double OccupiedShare() const;

  // Density above which the cell is occupied: kMinOpacity over the cell's size in scene units.
  float Threshold(std::uint32_t cell) const;

  std::vector<float>& density() { return density_; }
  const std::vector<float>& density() const { return density_; }
  std::vector<std::uint8_t>& distance() { return distance_; }
  // To be called after distances were set through distance().
  void Refresh();

 private:
  static constexpr float kEmpty = -1.f, kPresumedEmpty = -2.f;
  // Longest jump that is remembered; longer ones gain nothing, because rays leave the cube.
  static constexpr int kMaxDistance = 24;
  static constexpr std::uint32_t kBlock = 4;  // side of a block, whose cells fill a word of 64 bits

  int resolution_ = 0;
  SceneContraction contraction_;
  std::vector<float> density_;
  std::vector<std::uint8_t> distance_;
  // Per block: the least distance of its cells, 0 where one is occupied, and a bit for each that is.
  std::vector<std::uint8_t> block_distance_;
  std::vector<std::uint64_t> block_cells_;
};

}  // namespace nerf
