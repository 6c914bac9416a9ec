// Which pictures probably overlap, told from few of their features.
#pragma once

#include <vector>

#include "sfm/features/features.h"
#include "sfm/features/image_pairs.h"

namespace sfm {

// Each picture with the `partners` it shares most matches with among its 384 features of largest scale. A few
// hundred large features predict overlap well: Wu, "Towards Linear-Time Incremental Structure from Motion",
// 3DV 2013, section 3 (preemptive matching). Pairs sharing fewer than 4 are left out. Cost: n^2 / 2 products
// of 384 x 384 x 128 bytes, 0.1 ms each with AVX-512.
ImagePairs LikelyPairs(const std::vector<Features>& pictures, int partners, int threads);

}  // namespace sfm
