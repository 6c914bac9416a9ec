#include "nerf/data/occupancy_init.h"

#include <cmath>
#include <limits>
#include <numeric>

#include "io/base/check.h"

namespace nerf {
namespace {

// The corners of a cell and its centre, in scene coordinates.
using CellPoints = std::array<Eigen::Vector3f, 9>;

// Projects the ball around a cell into a pinhole view.
struct Projector {
  explicit Projector(const io::Scene& scene, const io::Frame& frame) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const io::Rigid3d cam_from_world = frame.world_from_cam.Inverse();
    rotation = cam_from_world.rotation.cast<float>();
    translation = cam_from_world.translation.cast<float>();
    position = frame.world_from_cam.translation.cast<float>();
    fl_x = static_cast<float>(camera.fl_x), fl_y = static_cast<float>(camera.fl_y);
    cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
    width = static_cast<float>(camera.width), height = static_cast<float>(camera.height);
  }

  // False when the ball reaches behind the camera, where its projection is no disc.
  bool Project(
      const Eigen::Vector3f& x, float radius, Eigen::Vector2f* centre, float* depth, float* radius_px) const {
    const Eigen::Vector3f in_cam = rotation * x + translation;
    *depth = -in_cam.z();
    if (!(*depth > radius)) return false;
    *centre = {fl_x * in_cam.x() / *depth + cx, -fl_y * in_cam.y() / *depth + cy};
    // The silhouette of a ball off the axis is stretched by at most 1 / cos; depth - radius bounds its near
    // side.
    const float slant = in_cam.norm() / *depth;
    *radius_px = std::max(fl_x, fl_y) * radius / (*depth - radius) * slant;
    return true;
  }
  bool Contains(const Eigen::Vector2f& p, float margin) const {
    return p.x() >= margin && p.y() >= margin && p.x() <= width - margin && p.y() <= height - margin;
  }

  // Whether a corner or the centre of the cell lies on a used pixel and beyond `near`, or the camera is
  // inside the cell. uses(x, y) tells used pixels.
  template <typename Uses>
  bool SeesAny(const CellPoints& points, float near, const Uses& uses) const {
    float nearest = std::numeric_limits<float>::infinity();
    for (const Eigen::Vector3f& point : points) {
      const Eigen::Vector3f in_cam = rotation * point + translation;
      const float depth = -in_cam.z(), distance = in_cam.norm();
      nearest = std::min(nearest, distance);
      if (!(depth > 0 && distance > near)) continue;
      const Eigen::Vector2f p(fl_x * in_cam.x() / depth + cx, -fl_y * in_cam.y() / depth + cy);
      if (Contains(p, 0) && uses(p.x(), p.y())) return true;
    }
    return nearest < (points[8] - points[0]).norm() && nearest > near;
  }

  // Whether the cell lies nearer than `near`, with its centre on a used pixel.
  template <typename Uses>
  bool SeesThrough(const CellPoints& points, float near, const Uses& uses) const {
    for (auto point = points.rbegin(); point != points.rend(); ++point) {  // the centre decides nearly always
      if (!((*point - position).squaredNorm() < near * near)) return false;
    }
    const Eigen::Vector3f centre = rotation * points[8] + translation;
    const float depth = -centre.z();
    if (!(depth > 0)) return false;
    const Eigen::Vector2f p(fl_x * centre.x() / depth + cx, -fl_y * centre.y() / depth + cy);
    return Contains(p, 0) && uses(p.x(), p.y());
  }

  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation, position;  // position: of the camera, scene coordinates
  float fl_x, fl_y, cx, cy, width, height;
};

// Whether a rectangle's pixels have alpha > 0: none, some or all of them.
enum class Coverage { kNone, kSome, kAll };

// Number of pixels with alpha > 0 in any rectangle, from a summed-area table.
class AlphaCount {
 public:
  AlphaCount(const Dataset& dataset, const View& view) : width_(view.width), height_(view.height) {
    const auto stride = static_cast<std::size_t>(width_) + 1;
    sums_.assign(stride * (static_cast<std::size_t>(height_) + 1), 0);
    for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y) {
      std::uint32_t row = 0;
      for (std::size_t x = 0; x < static_cast<std::size_t>(width_); ++x) {
        row += dataset.pixels[(view.first_pixel + y * static_cast<std::size_t>(width_) + x) * 4 + 3] > 0;
        sums_[(y + 1) * stride + x + 1] = sums_[y * stride + x + 1] + row;
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
    const auto stride = static_cast<std::size_t>(width_) + 1;
    const std::size_t count = std::size_t{sums_[y1 * stride + x1]} + sums_[y0 * stride + x0] -
                              sums_[y0 * stride + x1] - sums_[y1 * stride + x0];
    if (count == 0) return Coverage::kNone;
    return count == (x1 - x0) * (y1 - y0) ? Coverage::kAll : Coverage::kSome;
  }

 private:
  int width_, height_;
  std::vector<std::uint32_t> sums_;
};

void CellPointsOf(const OccupancyGrid& grid,
                  const SceneContraction& contraction,
                  std::uint32_t cell,
                  CellPoints* points) {
  const std::array<float, 3> unit = grid.CellCentre(cell);
  const float half = 0.5f / static_cast<float>(grid.resolution());
  contraction.FromUnit(unit.data(), (*points)[8].data());
  for (std::size_t corner = 0; corner < 8; ++corner) {
    float at[3];
    // Cells on the faces of a contracted cube reach infinity; staying inside by 1 % of a cell keeps them
    // finite.
    for (std::size_t i = 0; i < 3; ++i) at[i] = unit[i] + (corner >> i & 1 ? 0.99f : -0.99f) * half;
    contraction.FromUnit(at, (*points)[corner].data());
  }
}

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

  // Marks the cells of the block with the given first cell and side, and widens the box around the
  // candidates. views: those that do not see all of it on opaque pixels.
  void Carve(const std::array<int, 3>& first,
             int side,
             const std::vector<std::size_t>& views,
             std::array<float, 6>* box) const {
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
      if (empty) return;
      const float cell_size = 1.f / static_cast<float>(grid_->resolution());
      for (std::size_t i = 0; i < 3; ++i) {
        (*box)[i] = std::min((*box)[i], static_cast<float>(first[i]) * cell_size);
        (*box)[i + 3] = std::max((*box)[i + 3], static_cast<float>(first[i] + side) * cell_size);
      }
    } else {
      const int half = side / 2;
      for (int child = 0; child < 8; ++child) {
        Carve({first[0] + (child & 1) * half,
               first[1] + (child >> 1 & 1) * half,
               first[2] + (child >> 2) * half},
              half,
              undecided,
              box);
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

}  // namespace

std::array<float, 6> CarveByMasks(const io::Scene& scene,
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
  std::vector<std::array<float, 6>> boxes(static_cast<std::size_t>(per_axis * per_axis * per_axis),
                                          {1, 1, 1, 0, 0, 0});
  workers->Run(static_cast<int>(boxes.size()), [&](int i, int) {
    carver.Carve({i % per_axis * kBlock, i / per_axis % per_axis * kBlock, i / per_axis / per_axis * kBlock},
                 kBlock,
                 all,
                 &boxes[static_cast<std::size_t>(i)]);
  });
  std::array<float, 6> box = {1, 1, 1, 0, 0, 0};
  for (const auto& b : boxes) {
    for (std::size_t i = 0; i < 3; ++i)
      box[i] = std::min(box[i], b[i]), box[i + 3] = std::max(box[i + 3], b[i + 3]);
  }
  return box;
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
  const int n = grid->resolution();
  workers->Run(n, [&](int slab, int) {
    const auto cells = static_cast<std::uint32_t>(n) * static_cast<std::uint32_t>(n);
    for (std::uint32_t cell = static_cast<std::uint32_t>(slab) * cells;
         cell < static_cast<std::uint32_t>(slab + 1) * cells;
         ++cell) {
      CellPoints points;
      CellPointsOf(*grid, contraction, cell, &points);
      int seen = 0;
      bool seen_through = false;
      for (std::size_t v = 0; v < projectors.size() && !seen_through; ++v) {
        const View& view = dataset.views[v];
        const auto uses = [&](float x, float y) {
          if (used.empty()) return true;
          const int column = std::min(static_cast<int>(x), view.width - 1),
                    row = std::min(static_cast<int>(y), view.height - 1);
          return bool{used[view.first_pixel + static_cast<std::size_t>(row * view.width + column)]};
        };
        seen += seen < 2 && projectors[v].SeesAny(points, static_cast<float>(near), uses);
        seen_through = projectors[v].SeesThrough(points, static_cast<float>(near), uses);
      }
      seen >= 2 && !seen_through ? grid->SetCandidate(cell) : grid->SetEmpty(cell);
    }
  });
}

}  // namespace nerf
