#include "nerf/surface/sparse_volume.h"

#include "io/base/check.h"

namespace nerf {
namespace {

std::uint64_t KeyOf(const Eigen::Vector3i& place) {
  std::uint64_t key = 0;
  for (const int p : place) key = key << 21 | static_cast<std::uint64_t>(p + SparseVolume::kMaxPlace);
  return key;
}

}  // namespace

SparseVolume::SparseVolume(const Eigen::Vector3d& origin, double voxel, std::vector<Eigen::Vector3i> places)
    : origin_(origin), voxel_(voxel), places_(std::move(places)) {
  PIPELINE_CHECK_GT(voxel, 0);
  Block unknown;
  unknown.fill(kUnknown);
  blocks_.assign(places_.size(), unknown);
  index_.reserve(places_.size());
  for (std::size_t i = 0; i < places_.size(); ++i) {
    PIPELINE_CHECK(places_[i].minCoeff() >= -kMaxPlace && places_[i].maxCoeff() < kMaxPlace);
    PIPELINE_CHECK(index_.emplace(KeyOf(places_[i]), static_cast<int>(i)).second);
  }
}

int SparseVolume::Find(const Eigen::Vector3i& place) const {
  const auto found = index_.find(KeyOf(place));
  return found == index_.end() ? -1 : found->second;
}

}  // namespace nerf
