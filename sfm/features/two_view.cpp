#include "sfm/features/two_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <opencv2/calib3d.hpp>

#include "io/process/parallel.h"
#include "io/process/progress.h"

namespace sfm {
namespace {

constexpr double kMaxErrorPx = 4;
// That a sample was free of mismatches. At the usual 0.999 the search ends with the first good sample; the
// better ones that come later have a tenth more support where matches are few.
constexpr double kConfidence = 1 - 1e-15;
constexpr int kMostSamples = 10000;
// Matches that a model is refined on at most, and how often it is.
constexpr int kRefinedMatches = 50, kRefinements = 10;
// A homography that explains so much of what epipolar geometry does is all there is: on one plane, and from
// one spot, that geometry is arbitrary.
constexpr double kMostHomographyShare = 0.8;

cv::UsacParams Usac() {
  cv::UsacParams params;
  params.threshold = kMaxErrorPx;
  params.confidence = kConfidence;
  params.maxIterations = kMostSamples;
  params.randomGeneratorState = 1;
  params.isParallel = false;
  params.sampler = cv::SAMPLING_UNIFORM;
  params.score = cv::SCORE_METHOD_RANSAC;
  params.loMethod = cv::LOCAL_OPTIM_INNER_AND_ITER_LO;
  params.loIterations = kRefinements;
  params.loSampleSize = kRefinedMatches;
  return params;
}

// Which matches support a model.
struct Support {
  std::vector<std::uint8_t> mask;
  std::size_t count = 0;
  bool IsEnough() const { return count >= kLeastTwoViewMatches; }
};

// estimate(params, mask): the mask stays empty where no sample has a model.
template <typename Estimate>
Support SupportOf(const Estimate& estimate) {
  Support support;
  estimate(Usac(), support.mask);
  support.count = static_cast<std::size_t>(std::count_if(
      support.mask.begin(), support.mask.end(), [](std::uint8_t supports) { return supports != 0; }));
  return support;
}

}  // namespace

TwoViewGeometry EstimateTwoViewGeometry(const std::vector<Keypoint>& keypoints_a,
                                        const std::vector<Keypoint>& keypoints_b,
                                        const std::vector<std::array<int, 2>>& matches) {
  if (matches.size() < kLeastTwoViewMatches) return {};
  std::vector<cv::Point2d> a, b;
  for (const auto& [in_a, in_b] : matches) {
    const Keypoint &at_a = keypoints_a[static_cast<std::size_t>(in_a)],
                   &at_b = keypoints_b[static_cast<std::size_t>(in_b)];
    a.emplace_back(at_a.x, at_a.y), b.emplace_back(at_b.x, at_b.y);
  }
  const Support epipolar =
      SupportOf([&](const auto& params, auto& mask) { cv::findFundamentalMat(a, b, mask, params); });
  const Support homography =
      SupportOf([&](const auto& params, auto& mask) { cv::findHomography(a, b, mask, params); });
  const bool is_flat =
      homography.IsEnough() &&
      static_cast<double>(homography.count) > kMostHomographyShare * static_cast<double>(epipolar.count);
  if (!is_flat && !epipolar.IsEnough()) return {};
  const Support& best = is_flat && homography.count > epipolar.count ? homography : epipolar;
  TwoViewGeometry geometry{.kind = is_flat ? TwoViewKind::kHomography : TwoViewKind::kEpipolar,
                           .matches = {}};
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (best.mask[i]) geometry.matches.push_back(matches[i]);
  }
  return geometry;
}

std::vector<TwoViewGeometry> EstimateTwoViewGeometries(const std::vector<Features>& features,
                                                       const std::vector<PairMatches>& pairs,
                                                       int threads) {
  std::vector<TwoViewGeometry> geometries(pairs.size());
  std::mutex mutex;
  io::Progress progress("verifying");  // guarded by it, as `done` is
  std::size_t done = 0;
  io::ParallelFor(pairs.size(), threads, [&](std::size_t i) {
    const auto a = static_cast<std::size_t>(pairs[i].a), b = static_cast<std::size_t>(pairs[i].b);
    geometries[i] = EstimateTwoViewGeometry(features[a].keypoints, features[b].keypoints, pairs[i].matches);
    const std::lock_guard lock(mutex);
    progress.Update(static_cast<double>(++done) / static_cast<double>(pairs.size()),
                    fmt::format("{} pairs", pairs.size()));
  });
  return geometries;
}

}  // namespace sfm
