// Values on a cubic lattice that has blocks of 8^3 samples only where something is.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

namespace nerf {

class SparseVolume {
 public:
  static constexpr int kSide = 8;
  static constexpr std::size_t kSamples = kSide * kSide * kSide;
  static constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  // Sample (x, y, z) of a block, x fastest, at Origin() + voxel * (kSide * place + (x, y, z)).
  using Block = std::array<float, kSamples>;

  // Blocks at the given places, all samples unknown. origin: of sample (0, 0, 0) of the block at (0, 0, 0).
  // Places lie in [-kMaxPlace, kMaxPlace); a place that is given twice is a bug of the caller.
  SparseVolume(const Eigen::Vector3d& origin, double voxel, std::vector<Eigen::Vector3i> places);
  static constexpr int kMaxPlace = 1 << 20;

  std::size_t size() const { return places_.size(); }
  double voxel() const { return voxel_; }
  const Eigen::Vector3d& origin() const { return origin_; }
  const Eigen::Vector3i& place(std::size_t block) const { return places_[block]; }
  Block& block(std::size_t i) { return blocks_[i]; }
  const Block& block(std::size_t i) const { return blocks_[i]; }
  // The block at a place, or -1.
  int Find(const Eigen::Vector3i& place) const;
  // Where the first sample of a block lies.
  Eigen::Vector3d Corner(std::size_t block) const {
    return origin_ + voxel_ * kSide * places_[block].cast<double>();
  }

  static std::size_t Index(int x, int y, int z) {
    return static_cast<std::size_t>((z * kSide + y) * kSide + x);
  }

 private:
  Eigen::Vector3d origin_;
  double voxel_;
  std::vector<Eigen::Vector3i> places_;
  std::vector<Block> blocks_;
  std::unordered_map<std::uint64_t, int> index_;  // by place
};

}  // namespace nerf
