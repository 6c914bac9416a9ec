#include "sfm/features/stationary_matches.h"

#include <algorithm>
#include <cmath>

namespace sfm {
namespace {

constexpr float kStationaryPx = 4;
// Between the two limits a match may be either.
constexpr float kMovingPx = 12;
constexpr int kMinMatches = 15;  // as many as two-view geometry needs
constexpr double kMinStationaryShare = 0.2;
constexpr double kMinSplitShare = 0.5;
constexpr int kCells = 8;  // along each side of the grid of StationaryShare::covered

float Displacement(const std::vector<Features>& features,
                   const PairMatches& pair,
                   const std::array<int, 2>& match) {
  const Keypoint& a =
      features[static_cast<std::size_t>(pair.a)].keypoints[static_cast<std::size_t>(match[0])];
  const Keypoint& b =
      features[static_cast<std::size_t>(pair.b)].keypoints[static_cast<std::size_t>(match[1])];
  return std::hypot(a.x - b.x, a.y - b.y);
}

// Share of the cells of a grid over all keypoints of the capture in which matches stand still, and not only
// by chance among many that move.
double CoveredShare(const std::vector<Features>& features, const std::vector<PairMatches>& matches) {
  float width = 1, height = 1;
  for (const Features& picture : features) {
    for (const Keypoint& keypoint : picture.keypoints) {
      width = std::max(width, keypoint.x);
      height = std::max(height, keypoint.y);
    }
  }
  std::array<int, kCells * kCells> stationary{}, all{};
  const auto cell = [](float x, float size) {
    return std::clamp(static_cast<int>(x / size * kCells), 0, kCells - 1);
  };
  for (const PairMatches& pair : matches) {
    for (const auto& match : pair.matches) {
      const Keypoint& at =
          features[static_cast<std::size_t>(pair.a)].keypoints[static_cast<std::size_t>(match[0])];
      const auto index = static_cast<std::size_t>(cell(at.y, height) * kCells + cell(at.x, width));
      ++all[index];
      stationary[index] += Displacement(features, pair, match) <= kStationaryPx;
    }
  }
  int covered = 0;
  for (std::size_t i = 0; i < all.size(); ++i)
    covered += stationary[i] >= kMinMatches && stationary[i] >= kMinStationaryShare * all[i];
  return covered / static_cast<double>(all.size());
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
  share.covered = CoveredShare(features, *matches);
  std::size_t all = 0;
  for (const PairMatches& pair : *matches) all += pair.matches.size();
  share.removed = DropStationaryMatches(features, matches);
  share.share = static_cast<double>(share.removed) / static_cast<double>(all);
  return share;
}

std::size_t DropStationaryMatches(const std::vector<Features>& features, std::vector<PairMatches>* matches) {
  std::size_t removed = 0;
  for (PairMatches& pair : *matches) {
    removed += std::erase_if(pair.matches, [&](const std::array<int, 2>& match) {
      return Displacement(features, pair, match) <= kStationaryPx;
    });
  }
  return removed;
}

}  // namespace sfm
