#include "sfm/features/stationary_matches.h"

#include <algorithm>
#include <cmath>

namespace sfm {
namespace {

constexpr float kStationaryPx = 4;
// Between the two limits a match may be either.
constexpr float kMovingPx = 12;
constexpr int kMinMatches = 15;  // as many as COLMAP needs to verify a pair
constexpr double kMinStationaryShare = 0.2;
constexpr double kMinSplitShare = 0.5;

float Displacement(const std::vector<Features>& features,
                   const PairMatches& pair,
                   const std::array<int, 2>& match) {
  const Keypoint& a =
      features[static_cast<std::size_t>(pair.a)].keypoints[static_cast<std::size_t>(match[0])];
  const Keypoint& b =
      features[static_cast<std::size_t>(pair.b)].keypoints[static_cast<std::size_t>(match[1])];
  return std::hypot(a.x - b.x, a.y - b.y);
}

}  // namespace

StationaryShare RemoveStationaryMatches(const std::vector<Features>& features,
                                        std::vector<PairMatches>* matches) {
  StationaryShare share;
  for (const PairMatches& pair : *matches) {
    int stationary = 0, moving = 0;
    for (const auto& match : pair.matches) {
      const float displacement = Displacement(features, pair, match);
      stationary += displacement <= kStationaryPx;
      moving += displacement >= kMovingPx;
    }
    if (moving < kMinMatches) continue;
    ++share.pairs;
    share.split_pairs += stationary >= kMinMatches &&
                         stationary >= kMinStationaryShare * static_cast<double>(pair.matches.size());
  }
  if (share.split_pairs == 0 || share.split_pairs < kMinSplitShare * share.pairs) return share;
  for (PairMatches& pair : *matches) {
    share.removed += std::erase_if(pair.matches, [&](const std::array<int, 2>& match) {
      return Displacement(features, pair, match) <= kStationaryPx;
    });
  }
  return share;
}

}  // namespace sfm
