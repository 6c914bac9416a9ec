#include "sfm/features/image_pairs.h"

namespace sfm {

ImagePairs AllPairs(int n) { return SequentialPairs(n, n); }

ImagePairs SequentialPairs(int n, int overlap) {
  ImagePairs pairs;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n && j <= i + overlap; ++j) pairs.emplace(i, j);
  }
  return pairs;
}

}  // namespace sfm
