#include "sfm/choose_pairs.h"

#include <fmt/format.h>

#include <algorithm>

#include "sfm/features/likely_pairs.h"

namespace sfm {
namespace {

// Matching a pair takes 14 ms of one core, verifying it 1 to 3 ms: up to here all pairs cost seconds. More
// pairs also take the mapper longer.
constexpr int kMaxExhaustivePictures = 30;
// Partners kept per picture beyond that.
constexpr int kPartners = 20;
// Neighbours in the order of names are matched in any case: people walk.
constexpr int kPhotoOverlap = 2;
// Chosen video frames move on steadily; loops are found among the likely partners.
constexpr int kVideoOverlap = 8;
constexpr int kVideoPartners = 8;

}  // namespace

ImagePairs ChoosePairs(const std::vector<Picture>& pictures,
                       const std::vector<Features>& features,
                       const ReconstructionOptions& options,
                       const std::function<void(const std::string&)>& decide) {
  const int n = static_cast<int>(pictures.size());
  const bool video =
      std::all_of(pictures.begin(), pictures.end(), [](const Picture& p) { return p.is_video_frame; });
  std::string way = options.matching;
  if (way == "auto") way = n <= kMaxExhaustivePictures ? "exhaustive" : video ? "sequential" : "likely";
  const int all = n * (n - 1) / 2;
  if (way == "exhaustive") {
    decide(fmt::format("matching all {} pairs of {} pictures", all, n));
    return AllPairs(n);
  }
  const bool sequential = way == "sequential";
  ImagePairs pairs = LikelyPairs(features, sequential ? kVideoPartners : kPartners, options.threads);
  pairs.merge(SequentialPairs(n, sequential ? kVideoOverlap : kPhotoOverlap));
  decide(fmt::format("matching {} of {} pairs: {} by a quick comparison of the largest features",
                     pairs.size(),
                     all,
                     sequential ? "following frames, and loops found" : "the most alike"));
  return pairs;
}

}  // namespace sfm
