#include "nerf/data/hull_pixels.h"

#include <algorithm>
#include <cmath>

namespace nerf {
namespace {

// A cell stays in the hull when the square around its projection, of half side r, holds a pixel that is not
// transparent; a ray through the cell is within r of its centre. Returns 2 r and two pixels for rounding; the
// longer side of the picture when the camera is inside the cube, or too near to tell.
int ReachInPixels(const io::Camera& camera,
                  const Eigen::Vector3d& position,
                  const SceneContraction& contraction,
                  int cells) {
  const double half_x = 0.5 * camera.width / camera.fl_x, half_y = 0.5 * camera.height / camera.fl_y;
  const double slant = std::sqrt(1 + half_x * half_x + half_y * half_y);  // distance / depth, at the corners
  const double radius = 0.5 * std::sqrt(3.0) * contraction.InnerSide() / cells;
  const Eigen::Vector3d centre(contraction.centre[0], contraction.centre[1], contraction.centre[2]);
  const double nearest = (position - centre).norm() - std::sqrt(3.0) * contraction.half;
  const double depth = nearest / slant - radius;
  const int all = std::max(camera.width, camera.height);
  if (depth <= radius) return all;
  const double reach = 2 * std::max(camera.fl_x, camera.fl_y) * radius / depth * slant + 2;
  return static_cast<int>(std::min(std::ceil(reach), static_cast<double>(all)));
}

// For each pixel of the view whether one with alpha > 0 lies within `reach` in both directions. Along rows,
// then along columns, each as distances to the last one seen, forwards and backwards.
std::vector<std::uint8_t> NearOpaque(const Dataset& dataset, const View& view, int reach) {
  const int width = view.width, height = view.height;
  std::vector<std::uint8_t> along_row(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  std::vector<std::uint8_t> result = along_row;
  const std::uint8_t* alpha = &dataset.pixels[view.first_pixel * 4 + 3];
  for (int y = 0; y < height; ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    const auto scan = [&](int begin, int end, int step) {
      for (int x = begin, since = reach + 1; x != end; x += step) {
        const std::size_t pixel = row + static_cast<std::size_t>(x);
        since = alpha[pixel * 4] > 0 ? 0 : since + 1;
        along_row[pixel] |= since <= reach;
      }
    };
    scan(0, width, 1);
    scan(width - 1, -1, -1);
  }
  const auto scan = [&](int begin, int end, int step) {
    std::vector<int> since(static_cast<std::size_t>(width), reach + 1);
    for (int y = begin; y != end; y += step) {
      const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
      for (std::size_t x = 0; x < since.size(); ++x) {
        since[x] = along_row[row + x] ? 0 : since[x] + 1;
        result[row + x] |= since[x] <= reach;
      }
    }
  };
  scan(0, height, 1);
  scan(height - 1, -1, -1);
  return result;
}

// Whether each pixel of the view is to be kept.
std::vector<std::uint8_t> NearHull(const Dataset& dataset, const View& view, int reach) {
  std::vector<std::uint8_t> keep = NearOpaque(dataset, view, reach);
  const auto width = static_cast<std::size_t>(view.width), height = static_cast<std::size_t>(view.height);
  const auto at_border = [&](std::size_t pixel, std::size_t margin) {
    const std::size_t x = pixel % width, y = pixel / width;
    return std::min({x, y, width - 1 - x, height - 1 - y}) < margin;
  };
  // What the border cuts goes on beyond it, where nothing was seen.
  bool cut = false;
  for (std::size_t i = 0; i < keep.size() && !cut; ++i)
    cut = at_border(i, 1) && dataset.pixels[(view.first_pixel + i) * 4 + 3] > 0;
  for (std::size_t i = 0; i < keep.size() && cut; ++i)
    keep[i] |= at_border(i, static_cast<std::size_t>(reach));
  return keep;
}

}  // namespace

void DropPixelsBesideHull(const io::Scene& scene,
                          const SceneContraction& contraction,
                          int grid_resolution,
                          io::Workers* workers,
                          Dataset* dataset) {
  const std::vector<bool> used = dataset->UsedPixels();
  std::vector<std::vector<std::uint8_t>> keep(dataset->views.size());
  workers->Run(static_cast<int>(keep.size()), [&](int i, int) {
    const io::Frame& frame = scene.frames[static_cast<std::size_t>(i)];
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    const int reach = ReachInPixels(camera, frame.world_from_cam.translation, contraction, grid_resolution);
    keep[static_cast<std::size_t>(i)] =
        NearHull(*dataset, dataset->views[static_cast<std::size_t>(i)], reach);
  });
  std::vector<PixelRun> runs;
  std::uint32_t rank = 0, pixel = 0;
  for (const std::vector<std::uint8_t>& view : keep) {
    bool before = false;
    for (const std::uint8_t near_hull : view) {
      const bool kept = near_hull && (used.empty() || used[pixel]);
      if (kept && !before) runs.push_back({rank, pixel});
      rank += kept;
      before = kept;
      ++pixel;
    }
  }
  if (rank == 0) return;  // nothing is opaque anywhere; the pictures still say so
  runs.push_back({rank, pixel});
  dataset->runs = PixelRuns(std::move(runs));
}

}  // namespace nerf
