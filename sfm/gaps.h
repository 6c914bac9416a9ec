// Gaps of a walk: what of a capture lies around the pictures that a model lacks, in the order of the names,
// and what more there is to match.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "sfm/bundle/bundle_uncertainty.h"
#include "sfm/features/image_pairs.h"
#include "sfm/mapping/mapping_attempt.h"

namespace sfm {

// Pictures at most so far apart in the order of the names overlap where someone walked.
constexpr int kFollowing = 3;

// Indices of the pictures that the largest model lacks and of those that lie at most kFollowing from one of
// them, in order; empty when it has none of the latter, or lacks fewer than 3: these are no part of a walk.
std::vector<int> AroundGaps(const MappingAttempt& attempt);

// The pairs of these pictures that lie at most kFollowing apart.
ImagePairs FollowingPairs(const std::vector<int>& pictures);

// Median over the named pictures of an adjusted model: one standard deviation. Infinite without any of them.
double MedianRotationDeg(const io::ColmapModel& model,
                         const BundleUncertainty& uncertainty,
                         const std::set<std::string>& names);

// Puts the features of each picture behind those that it has, and their matches with them. Both lists of
// matches are of the same pairs.
void AddFeatures(const std::vector<Features>& added,
                 const std::vector<PairMatches>& added_matches,
                 std::vector<Features>* features,
                 std::vector<PairMatches>* matches);

}  // namespace sfm
