// Points of a surface with a direction, thinned evenly: one for each cell of a grid and each of the six sides
// that a surface there may face, so that the two faces of a thin thing stay apart.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace pipeline {

// A small piece of a surface, in scene coordinates.
struct Surfel {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit, outwards
  Eigen::Vector3d rgb = Eigen::Vector3d::Zero();     // sRGB in [0, 1]
  double spacing = 0;                                // distance to its neighbours on the surface
  int support = 0;                                   // training views that saw it
};

class SurfelGrid {
 public:
  // cell: side of the cells to begin with; it grows until at most max_surfels are left.
  SurfelGrid(double cell, std::size_t max_surfels) : cell_(cell), max_surfels_(max_surfels) {}

  // weight: in the mean of a cell, > 0.
  void Add(const Surfel& surfel, double weight);
  // Of every cell the mean; support is the largest. The order depends on the places alone.
  std::vector<Surfel> Thinned();
  double cell() const { return cell_; }

 private:
  using Key = std::array<std::int64_t, 4>;  // cell and side
  struct KeyHash {
    std::size_t operator()(const Key& key) const;
  };
  struct Sum {
    Surfel weighted;  // sums of weight times value; spacing: the least, support: the largest
    double weight = 0;
  };
  Key KeyOf(const Surfel& surfel) const;
  static Surfel Mean(const Sum& sum);
  static void Merge(const Sum& from, Sum* into);
  void Coarsen(std::size_t limit);

  double cell_;
  const std::size_t max_surfels_;
  std::unordered_map<Key, Sum, KeyHash> cells_;
};

}  // namespace pipeline
