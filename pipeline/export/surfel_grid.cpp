#include "pipeline/export/surfel_grid.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pipeline {
namespace {

// While points are added, so many times the wanted number may be held.
constexpr double kSlack = 1.5;
// A step of coarsening lets at least this much of the number go; surfaces thin by the square of the cell.
constexpr double kLeastGrowth = 1.02;

}  // namespace

std::size_t SurfelGrid::KeyHash::operator()(const Key& key) const {
  std::uint64_t hash = 0;
  for (const std::int64_t part : key) {  // Fibonacci hashing, the parts mixed by rotation
    hash = (hash << 21 | hash >> 43) ^ static_cast<std::uint64_t>(part);
    hash *= 0x9E3779B97F4A7C15u;
  }
  return hash ^ hash >> 32;
}

SurfelGrid::Key SurfelGrid::KeyOf(const Surfel& surfel) const {
  Key key;
  for (int c = 0; c < 3; ++c)
    key[static_cast<std::size_t>(c)] = static_cast<std::int64_t>(std::floor(surfel.position[c] / cell_));
  int axis = 0;
  surfel.normal.cwiseAbs().maxCoeff(&axis);
  key[3] = 2 * axis + (surfel.normal[axis] > 0 ? 1 : 0);
  return key;
}

void SurfelGrid::Merge(const Sum& from, Sum* into) {
  const bool is_first = into->weight == 0;
  into->weight += from.weight;
  into->weighted.position += from.weighted.position;
  into->weighted.normal += from.weighted.normal;
  into->weighted.rgb += from.weighted.rgb;
  into->weighted.spacing =
      is_first ? from.weighted.spacing : std::min(into->weighted.spacing, from.weighted.spacing);
  into->weighted.support = std::max(into->weighted.support, from.weighted.support);
}

Surfel SurfelGrid::Mean(const Sum& sum) {
  Surfel mean = sum.weighted;
  mean.position /= sum.weight;
  mean.normal.normalize();
  mean.rgb /= sum.weight;
  return mean;
}

void SurfelGrid::Add(const Surfel& surfel, double weight) {
  Sum sum{surfel, weight};
  sum.weighted.position *= sum.weight;
  sum.weighted.normal *= sum.weight;
  sum.weighted.rgb *= sum.weight;
  Merge(sum, &cells_[KeyOf(surfel)]);
  const double limit = kSlack * static_cast<double>(max_surfels_);
  if (static_cast<double>(cells_.size()) > limit) Coarsen(max_surfels_);
}

void SurfelGrid::Coarsen(std::size_t limit) {
  while (cells_.size() > limit) {
    const double excess = static_cast<double>(cells_.size()) / static_cast<double>(limit);
    cell_ *= std::max(kLeastGrowth, std::sqrt(excess));
    const auto finer = std::exchange(cells_, {});
    for (const auto& [key, sum] : finer) Merge(sum, &cells_[KeyOf(Mean(sum))]);
  }
}

std::vector<Surfel> SurfelGrid::Thinned() {
  Coarsen(max_surfels_);
  std::vector<std::pair<Key, const Sum*>> sorted;
  for (const auto& [key, sum] : cells_) sorted.push_back({key, &sum});
  std::sort(sorted.begin(), sorted.end());
  std::vector<Surfel> surfels;
  for (const auto& [key, sum] : sorted) {
    surfels.push_back(Mean(*sum));
    surfels.back().spacing = std::max(surfels.back().spacing, cell_);
  }
  return surfels;
}

}  // namespace pipeline
