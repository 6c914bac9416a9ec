#include "nerf/data/sight_lines.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "nerf/data/sparse_depth.h"
#include "nerf/sampling/cell_set.h"

namespace nerf {
namespace {

// Of the way to the point. The rest covers the error of its depth, and surfaces seen at a flat angle.
constexpr double kFreeShare = 0.9;
// Lines between cameras: each is paired with so many whose directions to the point are nearest to its own, of
// at most 60 degrees. Captures of many pictures thus span narrow fans, those of few wide ones.
constexpr std::size_t kPartners = 6;
constexpr float kMinCosine = 0.5f;
// Between two cameras, lines as far apart as they are wide, but no more than this.
constexpr int kMaxBetween = 32;
// Steps along a line, in cells: shorter than a cell, so that none is missed.
constexpr float kStepCells = 0.7f;
// Shortest step, as a share of the way: a line takes at most 10,000 of them, however far its point lies.
constexpr double kMinStep = 1e-4;
// Points farther out, in half sides of the cube, are left alone: contracted, they lie on its faces.
constexpr float kMaxReach = 1e6f;
constexpr float kLineCells = 3;
// Points are dealt out to so many groups.
constexpr std::size_t kGroups = 16;

// Marks the cells along sight lines.
class LineMarker {
 public:
  LineMarker(const SceneContraction& contraction, const OccupancyGrid& grid, CellSet* cells)
      : contraction_(contraction),
        grid_(grid),
        cell_(contraction.InnerSide() / static_cast<float>(grid.resolution())),
        cells_(*cells) {}

  void Mark(const Eigen::Vector3f& from, const Eigen::Vector3f& point) {
    const Eigen::Vector3f way = point - from;
    const double length = way.cast<double>().norm();
    for (double share = 0; share < kFreeShare;) {
      const Eigen::Vector3f x = from + way * static_cast<float>(share);
      float unit[3];
      contraction_.ToUnit(x.data(), unit);
      Insert(grid_.CellAt(unit), &cells_);
      share += std::max(kMinStep, static_cast<double>(kStepCells * CellSize(x)) / length);
    }
    ++n_lines_;
  }

  // Lines from between cameras a and b.
  void MarkBetween(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& point) {
    const float gap = (b - a).norm(), width = kLineCells * CellSize(a);
    const int n = static_cast<int>(std::min(gap / width, static_cast<float>(kMaxBetween)));
    for (int i = 1; i <= n; ++i)
      Mark(a + (b - a) * (static_cast<float>(i) / static_cast<float>(n + 1)), point);
  }

  std::size_t n_lines() const { return n_lines_; }

 private:
  // Side of the cell around x across the direction to the centre, along which contracted cells are longer.
  float CellSize(const Eigen::Vector3f& x) const {
    return cell_ * (contraction_.unbounded ? std::max(1.f, contraction_.Reach(x.data())) : 1.f);
  }

  const SceneContraction& contraction_;
  const OccupancyGrid& grid_;
  const float cell_;
  CellSet& cells_;
  std::size_t n_lines_ = 0;
};

// Whose directions to the point are nearest to that of observer `first`.
std::vector<std::size_t> Partners(const std::vector<Eigen::Vector3f>& directions, std::size_t first) {
  std::vector<std::pair<float, std::size_t>> by_angle;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const float cosine = directions[first].dot(directions[i]);
    if (i != first && cosine > kMinCosine) by_angle.push_back({-cosine, i});
  }
  const std::size_t n = std::min(by_angle.size(), kPartners);
  std::partial_sort(by_angle.begin(), by_angle.begin() + static_cast<std::ptrdiff_t>(n), by_angle.end());
  std::vector<std::size_t> partners;
  for (std::size_t i = 0; i < n; ++i) partners.push_back(by_angle[i].second);
  return partners;
}

void MarkLinesTo(const io::Point3D& point, const std::vector<Eigen::Vector3f>& cameras, LineMarker* marker) {
  const Eigen::Vector3f x = point.xyz.cast<float>();
  std::vector<Eigen::Vector3f> origins, directions;
  for (const int frame : point.frame_indices) {
    origins.push_back(cameras[static_cast<std::size_t>(frame)]);
    directions.push_back((x - origins.back()).normalized());
  }
  std::set<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < origins.size(); ++i) {
    marker->Mark(origins[i], x);
    for (const std::size_t partner : Partners(directions, i)) pairs.insert(std::minmax(i, partner));
  }
  for (const auto& [a, b] : pairs) marker->MarkBetween(origins[a], origins[b], x);
}

// Cells of three sets or more.
CellSet CellsOfThree(const std::vector<CellSet>& sets) {
  CellSet one(sets[0].size(), 0), two = one, three = one;
  for (const CellSet& set : sets) {
    for (std::size_t i = 0; i < set.size(); ++i) {
      three[i] |= two[i] & set[i];
      two[i] |= one[i] & set[i];
      one[i] |= set[i];
    }
  }
  return three;
}

}  // namespace

std::size_t CarveBySightLines(const io::Scene& scene,
                              const SceneContraction& contraction,
                              io::Workers* workers,
                              OccupancyGrid* grid) {
  std::vector<Eigen::Vector3f> cameras;
  for (const io::Frame& frame : scene.frames)
    cameras.push_back(frame.world_from_cam.translation.cast<float>());
  CellSet surface = EmptyCellSet(grid->resolution());
  std::vector<const io::Point3D*> points;
  for (const io::Point3D& point : scene.points) {
    if (point.frame_indices.size() < kMinObservers) continue;
    const Eigen::Vector3f x = point.xyz.cast<float>();
    if (!(contraction.Reach(x.data()) < kMaxReach)) continue;
    float unit[3];
    contraction.ToUnit(x.data(), unit);
    Insert(grid->CellAt(unit), &surface);
    points.push_back(&point);
  }
  std::vector<CellSet> lines(kGroups, EmptyCellSet(grid->resolution()));
  std::vector<std::size_t> n_lines(kGroups, 0);
  workers->Run(static_cast<int>(kGroups), [&](int task, int) {
    const auto group = static_cast<std::size_t>(task);
    LineMarker marker(contraction, *grid, &lines[group]);
    for (std::size_t i = group; i < points.size(); i += kGroups) MarkLinesTo(*points[i], cameras, &marker);
    n_lines[group] = marker.n_lines();
    CellSet scratch = lines[group];
    Dilate(grid->resolution(), &lines[group], &scratch);
  });
  const CellSet free = CellsOfThree(lines);
  CellSet scratch = surface;
  Dilate(grid->resolution(), &surface, &scratch);
  for (std::uint32_t cell = 0; cell < grid->n_cells(); ++cell) {
    if ((free[cell / 64] & ~surface[cell / 64]) >> cell % 64 & 1) grid->PresumeEmpty(cell);
  }
  return std::accumulate(n_lines.begin(), n_lines.end(), std::size_t{0});
}

}  // namespace nerf
