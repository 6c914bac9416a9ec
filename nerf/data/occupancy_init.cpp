#include "nerf/data/occupancy_init.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "io/base/check.h"
#include "nerf/data/projector.h"

namespace nerf {
namespace {

// Whether a rectangle's pixels have alpha > 0: none, some or all of them.
enum class Coverage { kNone, kSome, kAll };

// Number of pixels with alpha > 0 in any rectangle, from a summed-area table. Its sums are kept modulo 2^16,
// since the tables of all views are in memory together: rectangles of fewer pixels come out right, larger
// ones are counted by rows.
class AlphaCount {
 public:
  AlphaCount(const Dataset& dataset, const View& view) : width_(view.width), height_(view.height) {
    const auto stride = static_cast<std::size_t>(width_) + 1;
    sums_.assign(stride * (static_cast<std::size_t>(height_) + 1), 0);
    for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y) {
      std::uint16_t row = 0;
      for (std::size_t x = 0; x < static_cast<std::size_t>(width_); ++x) {
        row += dataset.pixels[(view.first_pixel + y * static_cast<std::size_t>(width_) + x) * 4 + 3] > 0;
        sums_[(y + 1) * stride + x + 1] = static_cast<std::uint16_t>(sums_[y * stride + x + 1] + row);
      }
    }
  }
  // Of the square around `centre`.
  Coverage In(const Eigen::Vector2f& centre, float radius) const {
    const auto clamp = [](float v, int limit) {
      return static_cast<std::size_t>(std::clamp(v, 0.f, static_cast<float>(limit)));
    };
    const std::size_t x0 = clamp(std::floor(centre.x() - radius), width_),
                      x1 = clamp(std::ceil(centre.x() + radius), width_);
    const std::size_t y0 = clamp(std::floor(centre.y() - radius), height_),
                      y1 = clamp(std::ceil(centre.y() + radius), height_);
    const std::size_t area = (x1 - x0) * (y1 - y0);
    std::size_t count = 0;
    if (area <= UINT16_MAX) {
      count = Count(x0, x1, y0, y1);
    } else {
      for (std::size_t y = y0; y < y1; ++y) count += Count(x0, x1, y, y + 1);
    }
    if (count == 0) return Coverage::kNone;
    return count == area ? Coverage::kAll : Coverage::kSome;
  }

 private:
  // Of at most UINT16_MAX pixels.
  std::uint16_t Count(std::size_t x0, std::size_t x1, std::size_t y0, std::size_t y1) const {
    const auto stride = static_cast<std::size_t>(width_) + 1;
    return static_cast<std::uint16_t>(sums_[y1 * stride + x1] + sums_[y0 * stride + x0] -
                                      sums_[y0 * stride + x1] - sums_[y1 * stride + x0]);
  }

  int width_, height_;
  std::vector<std::uint16_t> sums_;
};

// Carves the visual hull from blocks to cells: a block that some view sees wholly on transparent pixels is
// empty as one, a block that all views see on opaque pixels full as one, and only the others are looked at in
// finer parts, and there by those views alone that saw both kinds of pixels.
class HullCarver {
 public:
  HullCarver(const std::vector<Projector>& projectors,
             const std::vector<std::unique_ptr<AlphaCount>>& counts,
             const SceneContraction& contraction,
             OccupancyGrid* grid)
      : projectors_(projectors), counts_(counts), contraction_(contraction), grid_(grid) {}

  // Marks the cells of the block with the given first cell and side. views: those that do not see all of it
  // on opaque pixels.
  void Carve(const std::array<int, 3>& first, int side, const std::vector<std::size_t>& views) const {
    std::vector<std::size_t> undecided;
    const Coverage coverage = CoverageOf(first, side, views, &undecided);
    if (coverage == Coverage::kNone || coverage == Coverage::kAll || side == 1) {
      const bool empty = coverage == Coverage::kNone;
      for (int z = first[2]; z < first[2] + side; ++z) {
        for (int y = first[1]; y < first[1] + side; ++y) {
          for (int x = first[0]; x < first[0] + side; ++x)
            empty ? grid_->SetEmpty(CellOf({x, y, z})) : grid_->SetCandidate(CellOf({x, y, z}));
        }
      }
    } else {
      const int half = side / 2;
      for (int child = 0; child < 8; ++child) {
        Carve({first[0] + (child & 1) * half,
               first[1] + (child >> 1 & 1) * half,
               first[2] + (child >> 2) * half},
              half,
              undecided);
      }
    }
  }

 private:
  std::uint32_t CellOf(const std::array<int, 3>& cell) const {
    const int n = grid_->resolution();
    return static_cast<std::uint32_t>((cell[2] * n + cell[1]) * n + cell[0]);
  }

  // kNone when some view sees the ball around the block inside the picture and on transparent pixels only,
  // kAll when every view sees it inside the picture and on opaque pixels only; else the views that do not are
  // undecided.
  Coverage CoverageOf(const std::array<int, 3>& first,
                      int side,
                      const std::vector<std::size_t>& views,
                      std::vector<std::size_t>* undecided) const {
    const float cell_size = 1.f / static_cast<float>(grid_->resolution());
    float unit[3];
    Eigen::Vector3f centre;
    for (std::size_t i = 0; i < 3; ++i)
      unit[i] = (static_cast<float>(first[i]) + 0.5f * static_cast<float>(side)) * cell_size;
    contraction_.FromUnit(unit, centre.data());
    const float radius =
        0.5f * std::sqrt(3.f) * static_cast<float>(side) * cell_size * contraction_.InnerSide();
    for (const std::size_t v : views) {
      Eigen::Vector2f at;
      float depth, radius_px;
      Coverage seen = Coverage::kSome;
      if (projectors_[v].Project(centre, radius, &at, &depth, &radius_px) &&
          projectors_[v].Contains(at, radius_px)) {
        seen = counts_[v]->In(at, radius_px);
      }
      if (seen == Coverage::kNone) return seen;
      if (seen == Coverage::kSome) undecided->push_back(v);
    }
    return undecided->empty() ? Coverage::kAll : Coverage::kSome;
  }

  const std::vector<Projector>& projectors_;
  const std::vector<std::unique_ptr<AlphaCount>>& counts_;
  const SceneContraction& contraction_;
  OccupancyGrid* grid_;
};

// Carves by frusta, a block of cells at a time: a look at the box around the block spares its cells most
// views.
class FrustumCarver {
 public:
  static constexpr int kBlock = 4;  // cells along a side; the resolution is a multiple of 64

  FrustumCarver(const std::vector<Projector>& projectors,
                const Dataset& dataset,
                const std::vector<bool>& used,
                const SceneContraction& contraction,
                float near,
                OccupancyGrid* grid)
      : projectors_(projectors),
        dataset_(dataset),
        used_(used),
        contraction_(contraction),
        near_(near),
        grid_(grid) {}

  void Carve(const std::array<int, 3>& block) const {
    struct Cell {
      std::uint32_t index;
      CellPoints points;
    };
    std::array<Cell, kBlock * kBlock * kBlock> cells;
    Eigen::AlignedBox3f box;
    float largest = 0;  // distance of a cell's centre from its corners
    for (int i = 0; i < static_cast<int>(cells.size()); ++i) {
      Cell& cell = cells[static_cast<std::size_t>(i)];
      const int n = grid_->resolution(), x = block[0] * kBlock + i % kBlock,
                y = block[1] * kBlock + i / kBlock % kBlock, z = block[2] * kBlock + i / kBlock / kBlock;
      cell.index = static_cast<std::uint32_t>((z * n + y) * n + x);
      CellPointsOf(*grid_, contraction_, cell.index, &cell.points);
      for (const Eigen::Vector3f& point : cell.points) box.extend(point);
      largest = std::max(largest, (cell.points[8] - cell.points[0]).norm());
    }
    std::vector<std::size_t> facing, close;  // views that may see a cell, or see through it
    for (std::size_t v = 0; v < projectors_.size(); ++v) {
      const float distance2 = box.squaredExteriorDistance(projectors_[v].position);
      if (distance2 < largest * largest || projectors_[v].MaySee(box)) facing.push_back(v);
      if (distance2 < near_ * near_) close.push_back(v);
    }
    for (const Cell& cell : cells) {
      if (grid_->IsDeclaredEmpty(cell.index)) continue;
      SeenByTwo(cell.points, facing) && !SeenThrough(cell.points, close) ? grid_->SetCandidate(cell.index)
                                                                         : grid_->SetEmpty(cell.index);
    }
  }

 private:
  auto UsesOf(std::size_t v) const {
    return [this, &view = dataset_.views[v]](float x, float y) {
      if (used_.empty()) return true;
      const int column = std::min(static_cast<int>(x), view.width - 1),
                row = std::min(static_cast<int>(y), view.height - 1);
      return bool{used_[view.first_pixel + static_cast<std::size_t>(row * view.width + column)]};
    };
  }
  bool SeenByTwo(const CellPoints& points, const std::vector<std::size_t>& views) const {
    int seen = 0;
    for (std::size_t i = 0; i < views.size() && seen < 2; ++i)
      seen += projectors_[views[i]].SeesAny(points, near_, UsesOf(views[i]));
    return seen == 2;
  }
  bool SeenThrough(const CellPoints& points, const std::vector<std::size_t>& views) const {
    return std::any_of(views.begin(), views.end(), [&](std::size_t v) {
      return projectors_[v].SeesThrough(points, near_, UsesOf(v));
    });
  }

  const std::vector<Projector>& projectors_;
  const Dataset& dataset_;
  const std::vector<bool>& used_;
  const SceneContraction& contraction_;
  float near_;
  OccupancyGrid* grid_;
};

}  // namespace

void CarveByMasks(const io::Scene& scene,
                  const Dataset& dataset,
                  const SceneContraction& contraction,
                  io::Workers* workers,
                  OccupancyGrid* grid) {
  PIPELINE_CHECK_EQ(dataset.channels, 4);
  PIPELINE_CHECK(!contraction.unbounded);  // blocks of a contracted cube have no common radius
  const std::size_t n_views = dataset.views.size();
  std::vector<Projector> projectors;
  std::vector<std::unique_ptr<AlphaCount>> counts(n_views);
  for (const io::Frame& frame : scene.frames) projectors.emplace_back(scene, frame);
  workers->Run(static_cast<int>(n_views), [&](int i, int) {
    counts[static_cast<std::size_t>(i)] =
        std::make_unique<AlphaCount>(dataset, dataset.views[static_cast<std::size_t>(i)]);
  });
  const HullCarver carver(projectors, counts, contraction, grid);
  constexpr int kBlock = 16;  // side of the first blocks; the resolution is a multiple of 64
  const int per_axis = grid->resolution() / kBlock;
  std::vector<std::size_t> all(n_views);
  std::iota(all.begin(), all.end(), std::size_t{0});
  workers->Run(per_axis * per_axis * per_axis, [&](int i, int) {
    carver.Carve({i % per_axis * kBlock, i / per_axis % per_axis * kBlock, i / per_axis / per_axis * kBlock},
                 kBlock,
                 all);
  });
}

void CarveByFrusta(const io::Scene& scene,
                   const Dataset& dataset,
                   const SceneContraction& contraction,
                   double near,
                   io::Workers* workers,
                   OccupancyGrid* grid) {
  const std::vector<bool> used = dataset.UsedPixels();
  std::vector<Projector> projectors;
  for (const io::Frame& frame : scene.frames) projectors.emplace_back(scene, frame);
  const FrustumCarver carver(projectors, dataset, used, contraction, static_cast<float>(near), grid);
  const int per_axis = grid->resolution() / FrustumCarver::kBlock;
  workers->Run(per_axis * per_axis, [&](int row, int) {
    for (int x = 0; x < per_axis; ++x) carver.Carve({x, row % per_axis, row / per_axis});
  });
}

}  // namespace nerf
