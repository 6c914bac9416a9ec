// Which pictures are matched with which.
#pragma once

#include <set>
#include <utility>

namespace sfm {

// Indices of two pictures, the smaller first; sorted, without repetition.
using ImagePairs = std::set<std::pair<int, int>>;

ImagePairs AllPairs(int n);

// Each picture with the `overlap` that follow it.
ImagePairs SequentialPairs(int n, int overlap);

}  // namespace sfm
