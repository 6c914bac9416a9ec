// Which features of two pictures look alike.
#pragma once

#include <array>
#include <vector>

#include "sfm/features/features.h"
#include "sfm/features/image_pairs.h"

namespace sfm {

// Indices of two pictures, and of keypoints in the first and in the second.
struct PairMatches {
  int a = 0, b = 0;
  std::vector<std::array<int, 2>> matches;  // sorted
};

// Matches every pair of `pairs`: mutual nearest neighbours in descriptor space that pass Lowe's ratio test
// (0.8) from both sides and are not farther apart than 0.69 for unit vectors (about 40 degrees). Exact
// integer arithmetic (sfm/features/kernels/kernels.h): the result depends neither on the machine nor on
// `threads`. Pairs come in the order of `pairs`, those without matches included.
std::vector<PairMatches> MatchFeatures(const std::vector<Features>& features,
                                       const ImagePairs& pairs,
                                       int threads);

}  // namespace sfm
