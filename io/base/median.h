// The median and other quantiles of a list.
#pragma once

#include <algorithm>
#include <vector>

#include "io/base/check.h"

namespace io {

// The value of rank `rank` (0: the smallest) among values that need not be sorted.
template <typename T>
T ValueOfRank(std::vector<T> values, std::size_t rank) {
  PIPELINE_CHECK_LT(rank, values.size());
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The upper median; 0 without values.
template <typename T>
T Median(std::vector<T> values) {
  const std::size_t middle = values.size() / 2;
  return values.empty() ? T{} : ValueOfRank(std::move(values), middle);
}

// The median; of an even number the mean of the two middle ones. Not for an empty list.
inline double MeanMedian(const std::vector<double>& values) {
  const std::size_t n = values.size();
  return 0.5 * (ValueOfRank(values, (n - 1) / 2) + ValueOfRank(values, n / 2));
}

// The largest value of which at most the given share of the others lies below; 0 without values.
template <typename T>
T Quantile(std::vector<T> values, double share) {
  if (values.empty()) return T{};
  const auto rank = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1));
  return ValueOfRank(std::move(values), rank);
}

}  // namespace io
