#include "nerf/data/dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/base/check.h"
#include "io/base/parallel.h"
#include "io/image/mask.h"

namespace nerf {

using io::Error;
using io::ExitCode;

const View& Dataset::ViewOf(std::size_t pixel) const {
  return *(std::upper_bound(views.begin(),
                            views.end(),
                            pixel,
                            [](std::size_t p, const View& view) { return p < view.first_pixel; }) -
           1);
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
  io::Workers(threads).Run(static_cast<int>(n), [&](int i, int) {
    const io::Frame& frame = scene.frames[static_cast<std::size_t>(i)];
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    io::Image image = io::ReadImage(frame.image_path);
    if (image.width != camera.width || image.height != camera.height) {
      throw Error(ExitCode::kBadInput,
                  fmt::format("{}: is {}x{}, its camera {}x{}",
                              frame.image_path.string(),
                              image.width,
                              image.height,
                              camera.width,
                              camera.height));
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
