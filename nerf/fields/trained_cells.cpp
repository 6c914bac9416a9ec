#include "nerf/fields/trained_cells.h"

#include <algorithm>

namespace nerf {
namespace {

constexpr std::size_t kN = TrainedCells::kResolution;

// Sets cells beside those that are set in `from`, along the axis whose neighbours lie kStride cells apart.
template <std::size_t kStride>
void Dilate(const std::vector<std::uint8_t>& from, std::vector<std::uint8_t>* cells) {
  for (std::size_t i = 0; i < from.size(); ++i) {
    const std::size_t at = i / kStride % kN;
    if (at > 0) (*cells)[i] |= from[i - kStride];
    if (at + 1 < kN) (*cells)[i] |= from[i + kStride];
  }
}

}  // namespace

std::size_t TrainedCells::CellAt(float x, float y, float z) {
  const auto index = [](float u) {
    return static_cast<std::size_t>(
        std::clamp(static_cast<int>(u * static_cast<float>(kN)), 0, static_cast<int>(kN) - 1));
  };
  return (index(z) * kN + index(y)) * kN + index(x);
}

void TrainedCells::Mark(const Samples& samples, double progress) {
  const auto now = static_cast<std::uint8_t>(progress * kTimes);
  for (std::size_t i = 0; i < samples.x.size(); ++i)
    times_[CellAt(samples.x[i], samples.y[i], samples.z[i])] = now;
}

void TrainedCells::Refresh() {
  const std::uint8_t latest = *std::max_element(times_.begin(), times_.end());
  trained_.clear(), near_.clear();
  if (latest == 0) return;
  trained_.resize(times_.size());
  for (std::size_t i = 0; i < times_.size(); ++i) trained_[i] = 2 * times_[i] >= latest;
  // A surface that lies in one cell for training rays may lie in the next for other views.
  const std::vector<std::uint8_t> touched = trained_;
  Dilate<1>(touched, &trained_);
  Dilate<kN>(touched, &trained_);
  Dilate<kN * kN>(touched, &trained_);
  near_ = trained_;
  Dilate<1>(std::vector<std::uint8_t>(near_), &near_);
  Dilate<kN>(std::vector<std::uint8_t>(near_), &near_);
  Dilate<kN * kN>(std::vector<std::uint8_t>(near_), &near_);
}

}  // namespace nerf
