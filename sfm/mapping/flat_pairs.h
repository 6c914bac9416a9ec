// A homography H between two pictures has two causes: a camera that only turned, or one flat surface seen
// from two places. Only the second one measures depth.
#pragma once

#include <vector>

#include "sfm/colmap/colmap.h"

namespace sfm {

// Decides every pair that COLMAP left as PairGeometry::kHomography. It is a rotation where K_b^-1 H K_a is
// orthogonal up to scale, that is where one rotation carries the rays of the pair's inliers onto each other;
// elsewhere it is a plane. Focal lengths are known only roughly: one factor, common to all cameras and within
// what metadata (or the guess that stands in for them) can be off, is chosen so that most pairs become
// rotations. A capture that may be either is thus taken for a rotation.
void DistinguishFlatPairs(const CapturedViews& views, std::vector<VerifiedPair>* pairs);

}  // namespace sfm
