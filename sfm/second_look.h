// The second look at pictures that a model left out: what they are compared with, what that may cost, and
// whether the poses they get can be trusted.
#pragma once

#include <string>
#include <vector>

#include "sfm/features/image_pairs.h"
#include "sfm/mapping/mapping_attempt.h"

namespace sfm {

// Indices of the pictures that the largest model lacks; those with the most verified matches come first.
std::vector<int> LeftOutPictures(const MappingAttempt& attempt);

// Each of these with all others of `n`.
ImagePairs PairsWith(const std::vector<int>& pictures, int n);

// Descriptors compared to match the pairs.
double Comparisons(const std::vector<Features>& features, const ImagePairs& pairs);

// As many of `pictures`, in their order, as can be matched with all others within `ceiling` comparisons when
// each of them has up to `max_features`.
std::vector<int> WithinCeiling(const std::vector<int>& pictures,
                               const std::vector<Features>& features,
                               int max_features,
                               double ceiling);

// Takes those of `names` out of the largest model whose own pairs contradict their pose for the most part;
// returns them. A picture that was added to a finished model on little evidence may have been put anywhere.
std::vector<std::string> DropContradicted(const std::vector<std::string>& names, MappingAttempt* attempt);

}  // namespace sfm
