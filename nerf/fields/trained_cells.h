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
  static constexpr int kResolution = 128;  // cells per axis
  // A cell remembers the time of its last sample: 0 to kTimes, in proportion to the progress of training.
  static constexpr int kTimes = 200;

  TrainedCells() : times_(static_cast<std::size_t>(kResolution) * kResolution * kResolution, 0) {}

  // Of samples at `progress` in [0, 1], which never decreases.
  void Mark(const Samples& samples, double progress);
  // Whether the cell was touched in the second half of the training so far: at first, fog puts samples
  // everywhere. All cells of a field that nothing was marked for count as trained.
  bool Contains(float x, float y, float z) const { return 2 * times_[CellAt(x, y, z)] >= latest_; }
  bool empty() const { return latest_ == 0; }

  std::span<std::uint8_t> times() { return times_; }
  // To be called after times were set through times().
  void Refresh();

 private:
  static std::size_t CellAt(float x, float y, float z);

  std::vector<std::uint8_t> times_;
  std::uint8_t latest_ = 0;
};

}  // namespace nerf
