// Which pictures are matched with which. Matching is the dearest step without a GPU and its cost is per pair.
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "sfm/colmap_database.h"

namespace sfm {

// Indices of two pictures, the smaller first; sorted, without repetition.
using ImagePairs = std::set<std::pair<int, int>>;

ImagePairs AllPairs(int n);

// Each picture with the `overlap` that follow it.
ImagePairs SequentialPairs(int n, int overlap);

// Each picture with the `partners` it shares most mutual nearest neighbours with (ratio test 0.8) among its
// features of largest scale. A few hundred large features predict overlap well: Wu, "Towards Linear-Time
// Incremental Structure from Motion", 3DV 2013, section 3 (preemptive matching). Pairs sharing fewer than 4
// are left out. Cost n^2 / 2 small matrix products; the result does not depend on `threads`.
ImagePairs LikelyPairs(const std::vector<Descriptors>& pictures, int partners, int threads);

}  // namespace sfm
