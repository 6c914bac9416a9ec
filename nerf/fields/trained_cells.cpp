#include "nerf/fields/trained_cells.h"

#include <algorithm>

namespace nerf {

std::size_t TrainedCells::CellAt(float x, float y, float z) {
  const auto index = [](float u) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(u * kResolution), 0, kResolution - 1));
  };
  return (index(z) * kResolution + index(y)) * kResolution + index(x);
}

void TrainedCells::Mark(const Samples& samples, double progress) {
  latest_ = std::max(latest_, static_cast<std::uint8_t>(progress * kTimes));
  for (std::size_t i = 0; i < samples.x.size(); ++i)
    times_[CellAt(samples.x[i], samples.y[i], samples.z[i])] = latest_;
}

void TrainedCells::Refresh() { latest_ = *std::max_element(times_.begin(), times_.end()); }

}  // namespace nerf
