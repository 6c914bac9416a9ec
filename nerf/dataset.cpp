#include "nerf/dataset.h"

#include <algorithm>
#include <cmath>

#include "io/check.h"
#include "io/mask.h"
#include "nerf/parallel.h"

namespace nerf {

using io::Error;
using io::ExitCode;

RayCamera::RayCamera(const io::Camera& camera, const io::Rigid3d& world_from_cam, double pixel_offset) {
  if (camera.HasDistortion()) {
    throw Error(
        ExitCode::kBadInput, "camera has lens distortion", "Run `pipeline normalize`, which undistorts");
  }
  // One check here keeps NaN out of every ray, and so out of the grid's indices.
  if (!world_from_cam.rotation.allFinite() || !world_from_cam.translation.allFinite() ||
      !std::isfinite(camera.cx + camera.cy + 1.0 / camera.fl_x + 1.0 / camera.fl_y)) {
    throw Error(ExitCode::kBadInput, "a camera has a pose or intrinsics that are not finite");
  }
  inv_fl_x_ = static_cast<float>(1.0 / camera.fl_x);
  inv_fl_y_ = static_cast<float>(1.0 / camera.fl_y);
  cx_ = static_cast<float>(camera.cx - (pixel_offset - 0.5));
  cy_ = static_cast<float>(camera.cy - (pixel_offset - 0.5));
  for (int i = 0; i < 3; ++i) {
    origin_[i] = static_cast<float>(world_from_cam.translation[i]);
    for (int j = 0; j < 3; ++j) rotation_[3 * i + j] = static_cast<float>(world_from_cam.rotation(i, j));
  }
}

Ray RayCamera::RayThrough(int x, int y, float dx, float dy) const {
  const float u = (static_cast<float>(x) + 0.5f + dx - cx_) * inv_fl_x_,
              v = -(static_cast<float>(y) + 0.5f + dy - cy_) * inv_fl_y_;
  const float scale = 1.f / std::sqrt(u * u + v * v + 1.f);
  Ray ray;
  for (int i = 0; i < 3; ++i) {
    ray.origin[i] = origin_[i];
    ray.direction[i] = scale * (rotation_[3 * i] * u + rotation_[3 * i + 1] * v - rotation_[3 * i + 2]);
  }
  return ray;
}

PixelCell CellOfPixel(int index, int n_cells) {
  int columns = 1;
  while (columns * columns < n_cells) ++columns;
  return {index % columns, index / columns, 1.f / static_cast<float>(columns)};
}

const View& Dataset::ViewOf(std::size_t pixel) const {
  return *(std::upper_bound(views.begin(),
                            views.end(),
                            pixel,
                            [](std::size_t p, const View& view) { return p < view.first_pixel; }) -
           1);
}

PixelRuns::PixelRuns(std::vector<PixelRun> runs) : runs_(std::move(runs)) {
  for (std::size_t rank = 0, run = 0; rank < size(); rank += kBlock) {
    while (runs_[run + 1].first_rank <= rank) ++run;
    run_of_block_.push_back(static_cast<std::uint32_t>(run));
  }
}

std::vector<bool> Dataset::UsedPixels() const {
  std::vector<bool> used(runs.empty() ? 0 : n_pixels(), false);
  for (std::size_t rank = 0; rank < n_used() && !used.empty(); ++rank) used[UsedPixel(rank)] = true;
  return used;
}

namespace {

// The runs of one view per mask; none when all masks are empty.
std::vector<PixelRun> UsedRuns(const std::vector<View>& views, const std::vector<io::Mask>& masks) {
  std::vector<PixelRun> runs;
  if (std::all_of(masks.begin(), masks.end(), [](const io::Mask& mask) { return mask.used.empty(); }))
    return runs;
  std::uint32_t rank = 0, pixel = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::size_t n =
        static_cast<std::size_t>(views[i].width) * static_cast<std::size_t>(views[i].height);
    for (std::size_t p = 0; p < n; ++p, ++pixel) {
      if (!masks[i].Uses(p)) continue;
      if (p == 0 || !masks[i].Uses(p - 1)) runs.push_back({rank, pixel});
      ++rank;
    }
  }
  runs.push_back({rank, pixel});
  return runs;
}

}  // namespace

Dataset LoadDataset(const io::Scene& scene, int threads, double pixel_offset) {
  const std::size_t n = scene.frames.size();
  if (n == 0) throw Error(ExitCode::kBadInput, "the scene has no pictures");
  std::vector<io::Image> images(n);
  std::vector<io::Mask> masks(n);
  Workers(threads).Run(static_cast<int>(n), [&](int i, int) {
    const io::Frame& frame = scene.frames[static_cast<std::size_t>(i)];
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    io::Image image = io::ReadImage(frame.image_path);
    if (image.width != camera.width || image.height != camera.height) {
      throw Error(ExitCode::kBadInput,
                  frame.image_path.string() + ": is " + std::to_string(image.width) + "x" +
                      std::to_string(image.height) + ", its camera " + std::to_string(camera.width) + "x" +
                      std::to_string(camera.height));
    }
    images[static_cast<std::size_t>(i)] = std::move(image);
    if (frame.mask_path.empty()) return;
    masks[static_cast<std::size_t>(i)] = io::ReadMask(frame.mask_path, camera.width, camera.height);
  });
  bool has_alpha = false;
  for (const io::Image& image : images) {
    for (std::size_t p = 3; image.channels == 4 && !has_alpha && p < image.data.size(); p += 4)
      has_alpha = image.data[p] != 255;
  }
  Dataset dataset;
  dataset.channels = has_alpha ? 4 : 3;
  const auto channels = static_cast<std::size_t>(dataset.channels);
  std::size_t total = 0;
  for (const io::Image& image : images)
    total += static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  dataset.pixels.resize(total * channels);
  std::size_t first_pixel = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const io::Image& image = images[i];
    const io::Frame& frame = scene.frames[i];
    if (has_alpha && image.channels != 4) {
      throw Error(ExitCode::kBadInput,
                  frame.image_path.string() + ": has no alpha channel while other pictures do");
    }
    dataset.views.push_back(
        {frame.image_path.stem().string(),
         RayCamera(
             scene.cameras[static_cast<std::size_t>(frame.camera_index)], frame.world_from_cam, pixel_offset),
         image.width,
         image.height,
         first_pixel});
    first_pixel += static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
    const auto source_channels = static_cast<std::size_t>(image.channels);
    const std::size_t n_pixels = image.data.size() / source_channels;
    std::uint8_t* pixels = &dataset.pixels[dataset.views[i].first_pixel * channels];
    if (source_channels == channels) {
      std::copy(image.data.begin(), image.data.end(), pixels);
    } else {
      for (std::size_t p = 0; p < n_pixels; ++p)
        std::copy_n(&image.data[p * source_channels], channels, pixels + p * channels);
    }
    for (std::size_t p = 0; has_alpha && p < masks[i].used.size(); ++p) {
      if (!masks[i].Uses(p)) dataset.pixels[(dataset.views[i].first_pixel + p) * channels + 3] = 255;
    }
    images[i] = {};
  }
  dataset.runs = PixelRuns(UsedRuns(dataset.views, masks));
  return dataset;
}

}  // namespace nerf
