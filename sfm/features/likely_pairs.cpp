#include "sfm/features/likely_pairs.h"

#include <algorithm>

#include "sfm/features/shared_features.h"

namespace sfm {
namespace {

constexpr int kPreviewFeatures = 384;
constexpr int kMinShared = 4;  // Wu's threshold: fewer are chance

}  // namespace

ImagePairs LikelyPairs(const std::vector<Features>& pictures, int partners, int threads) {
  std::vector<Features> largest;
  for (const Features& picture : pictures) largest.push_back(LargestFeatures(picture, kPreviewFeatures));
  struct Partner {
    int index, shared;
  };
  std::vector<std::vector<Partner>> candidates(pictures.size());
  for (const PairMatches& pair :
       MatchOnAllRanks(largest, AllPairs(static_cast<int>(pictures.size())), threads)) {
    const int shared = static_cast<int>(pair.matches.size());
    if (shared < kMinShared) continue;
    candidates[static_cast<std::size_t>(pair.a)].push_back({pair.b, shared});
    candidates[static_cast<std::size_t>(pair.b)].push_back({pair.a, shared});
  }
  ImagePairs pairs;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    std::vector<Partner>& order = candidates[i];
    std::stable_sort(
        order.begin(), order.end(), [](const Partner& a, const Partner& b) { return a.shared > b.shared; });
    order.resize(std::min<std::size_t>(order.size(), static_cast<std::size_t>(partners)));
    for (const Partner& partner : order) pairs.emplace(std::minmax(static_cast<int>(i), partner.index));
  }
  return pairs;
}

}  // namespace sfm
