// Which cells of the unit cube training samples touch. A hashed level tells nothing of a place that none
// touches: what its table holds there belongs to other places, and shows as coloured noise.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "nerf/sampling/sampler.h"

namespace nerf {

class TrainedCells {
 public:
  static constexpr std::size_t kResolution = 128;  // cells per axis
  // A cell remembers the time of its last sample: 0 to kTimes, in proportion to the progress of training.
  static constexpr int kTimes = 200;

  TrainedCells() : times_(kResolution * kResolution * kResolution, 0) {}

  // Of samples at `progress` in [0, 1], which never decreases.
  void Mark(const Samples& samples, double progress);
  // A cell counts as trained when it, or one that shares a face with it, received a sample in the second half
  // of the training so far: at first, fog puts samples everywhere. All cells do while nothing is marked.
  void Refresh();
  // As of the last Refresh.
  bool Contains(float x, float y, float z) const { return trained_.empty() || trained_[CellAt(x, y, z)]; }
  bool ContainsAll() const { return trained_.empty(); }
  // Whether the cell or one of the 26 around it is trained: what lies elsewhere, no photograph showed.
  bool IsNear(float x, float y, float z) const { return near_.empty() || near_[CellAt(x, y, z)]; }

  // What a checkpoint stores; to be followed by Refresh() when it was changed.
  std::span<std::uint8_t> times() { return times_; }

 private:
  static std::size_t CellAt(float x, float y, float z);

  std::vector<std::uint8_t> times_;
  std::vector<std::uint8_t> trained_, near_;  // empty: all are
};

}  // namespace nerf
