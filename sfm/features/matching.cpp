#include "sfm/features/matching.h"

#include <fmt/format.h>

#include <mutex>

#include "io/base/parallel.h"
#include "io/base/progress.h"
#include "sfm/features/kernels/kernels.h"

namespace sfm {
namespace {

using kernels::Neighbour;

// Lowe's ratio 0.8 on distances is 16/25 on squared ones.
constexpr std::int64_t kRatioNumerator = 16, kRatioDenominator = 25;
// COLMAP accepts angles up to 0.7 between descriptors: 2 (1 - cos 0.7) = 0.47 of the squared length 512^2.
constexpr std::int32_t kMaxSquaredDistance = 123298;

bool IsDistinct(const Neighbour& n) {
  return n.index >= 0 && n.distance <= kMaxSquaredDistance &&
         kRatioDenominator * n.distance < kRatioNumerator * n.second;
}

}  // namespace

std::vector<PairMatches> MatchFeatures(const std::vector<Features>& features,
                                       const ImagePairs& pairs,
                                       int threads) {
  const kernels::Kernel& kernel = kernels::ActiveKernel();
  std::vector<kernels::Prepared> prepared(features.size());
  std::vector<PairMatches> matches(pairs.size());
  {
    std::size_t i = 0;
    for (const auto& [a, b] : pairs) {
      matches[i].a = a;
      matches[i++].b = b;
    }
  }
  io::Progress progress("sfm: matching");
  io::ParallelFor(features.size(), threads, [&](std::size_t i) {
    prepared[i] =
        kernel.prepare(features[i].descriptors.data(), static_cast<int>(features[i].keypoints.size()));
  });
  std::size_t done = 0;
  std::mutex mutex;
  io::ParallelFor(matches.size(), threads, [&](std::size_t i) {
    const auto &a = prepared[static_cast<std::size_t>(matches[i].a)],
               &b = prepared[static_cast<std::size_t>(matches[i].b)];
    std::vector<Neighbour> from_a(static_cast<std::size_t>(a.count)),
        from_b(static_cast<std::size_t>(b.count));
    kernel.nearest(a, b, from_a.data(), from_b.data());
    for (int k = 0; k < a.count; ++k) {
      const Neighbour& n = from_a[static_cast<std::size_t>(k)];
      if (!IsDistinct(n)) continue;
      const Neighbour& back = from_b[static_cast<std::size_t>(n.index)];
      if (back.index == k && IsDistinct(back)) matches[i].matches.push_back({k, n.index});
    }
    const std::lock_guard lock(mutex);
    ++done;
    progress.Update(static_cast<double>(done) / static_cast<double>(matches.size()),
                    fmt::format("{} of {} pairs", done, matches.size()));
  });
  return matches;
}

}  // namespace sfm
