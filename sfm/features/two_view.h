// Two-view geometry: which matches of two pictures one rigid scene explains.
#pragma once

#include <array>
#include <vector>

#include "sfm/features/features.h"
#include "sfm/features/matching.h"

namespace sfm {

// What explains a pair: epipolar geometry (a fundamental matrix), or a homography, which a flat scene and a
// rotation on the spot leave behind.
enum class TwoViewKind { kNone, kEpipolar, kHomography };

struct TwoViewGeometry {
  TwoViewKind kind = TwoViewKind::kNone;
  std::vector<std::array<int, 2>> matches;  // those that it explains, in the order given; of kNone: none
};

// Fewer matches than these explain nothing.
constexpr std::size_t kLeastTwoViewMatches = 15;

// By random samples of matches, each better model refined on what supports it (locally optimised RANSAC, Chum
// et al. 2003; OpenCV's USAC). A match supports a fundamental matrix when its Sampson error is at most 4
// pixels, a homography when it is carried to within 4 pixels. The choice is COLMAP's (Schoenberger and Frahm,
// "Structure-from-motion revisited", CVPR 2016, section 4.1), without an essential matrix: it explains no
// more than the fundamental one, and wants focal lengths. The samples are the same in each call.
TwoViewGeometry EstimateTwoViewGeometry(const std::vector<Keypoint>& keypoints_a,
                                        const std::vector<Keypoint>& keypoints_b,
                                        const std::vector<std::array<int, 2>>& matches);

// The same for every pair; features[i] are of picture i.
std::vector<TwoViewGeometry> EstimateTwoViewGeometries(const std::vector<Features>& features,
                                                       const std::vector<PairMatches>& pairs,
                                                       int threads);

}  // namespace sfm
