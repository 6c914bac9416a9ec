#include "sfm/features/matching.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <mutex>

#include "io/process/parallel.h"
#include "io/process/progress.h"
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

// Pictures whose descriptors are prepared together: those of two blocks are in memory at once.
constexpr int kBlock = 64;

std::vector<kernels::Prepared> Prepare(const kernels::Kernel& kernel,
                                       const std::vector<Features>& features,
                                       int block,
                                       int threads) {
  const std::size_t first = static_cast<std::size_t>(block) * kBlock,
                    n = std::min<std::size_t>(kBlock, features.size() - first);
  std::vector<kernels::Prepared> prepared(n);
  io::ParallelFor(n, threads, [&](std::size_t i) {
    const Features& of = features[first + i];
    prepared[i] = kernel.prepare(of.descriptors.data(), static_cast<int>(of.keypoints.size()));
  });
  return prepared;
}

std::vector<std::array<int, 2>> MatchesOf(const kernels::Kernel& kernel,
                                          const kernels::Prepared& a,
                                          const kernels::Prepared& b) {
  std::vector<Neighbour> from_a(static_cast<std::size_t>(a.count)), from_b(static_cast<std::size_t>(b.count));
  kernel.nearest(a, b, from_a.data(), from_b.data());
  std::vector<std::array<int, 2>> matches;
  for (int k = 0; k < a.count; ++k) {
    const Neighbour& n = from_a[static_cast<std::size_t>(k)];
    if (!IsDistinct(n)) continue;
    const Neighbour& back = from_b[static_cast<std::size_t>(n.index)];
    if (back.index == k && IsDistinct(back)) matches.push_back({k, n.index});
  }
  return matches;
}

}  // namespace

std::vector<PairMatches> MatchFeatures(const std::vector<Features>& features,
                                       const ImagePairs& pairs,
                                       int threads) {
  const kernels::Kernel& kernel = kernels::ActiveKernel();
  std::vector<PairMatches> matches(pairs.size());
  std::map<std::array<int, 2>, std::vector<PairMatches*>> of_blocks;
  {
    std::size_t i = 0;
    for (const auto& [a, b] : pairs) {
      matches[i].a = a;
      matches[i].b = b;
      of_blocks[{a / kBlock, b / kBlock}].push_back(&matches[i++]);
    }
  }
  io::Progress progress("matching");
  std::size_t done = 0;
  std::mutex mutex;
  std::vector<kernels::Prepared> first, second;
  int first_block = -1;
  for (const auto& [blocks, members] : of_blocks) {
    if (blocks[0] != first_block) first = {}, first = Prepare(kernel, features, blocks[0], threads);
    first_block = blocks[0];
    second = {};
    if (blocks[1] != blocks[0]) second = Prepare(kernel, features, blocks[1], threads);
    const std::vector<kernels::Prepared>& other = blocks[1] != blocks[0] ? second : first;
    io::ParallelFor(members.size(), threads, [&, &pairs = members](std::size_t i) {
      PairMatches* pair = pairs[i];
      pair->matches = MatchesOf(kernel,
                                first[static_cast<std::size_t>(pair->a % kBlock)],
                                other[static_cast<std::size_t>(pair->b % kBlock)]);
      const std::lock_guard lock(mutex);
      ++done;
      progress.Update(static_cast<double>(done) / static_cast<double>(matches.size()),
                      fmt::format("{} of {} pairs", done, matches.size()));
    });
  }
  return matches;
}

}  // namespace sfm
