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

io::Image ReadPicture(const io::Frame& frame, const io::Camera& camera) {
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
  return image;
}

bool HasAlpha(const std::vector<io::Image>& images) {
  for (const io::Image& image : images) {
    for (std::size_t p = 3; image.channels == 4 && p < image.data.size(); p += 4) {
      if (image.data[p] != 255) return true;
    }
  }
  return false;
}

// Copies a picture to its place in dataset->pixels. Pixels that are not used become opaque.
void CopyPicture(const io::Image& image, const io::Mask& mask, std::size_t first_pixel, Dataset* dataset) {
  const auto channels = static_cast<std::size_t>(dataset->channels),
             source_channels = static_cast<std::size_t>(image.channels);
  std::uint8_t* pixels = &dataset->pixels[first_pixel * channels];
  if (source_channels == channels) {
    std::copy(image.data.begin(), image.data.end(), pixels);
  } else {
    for (std::size_t p = 0; p < image.data.size() / source_channels; ++p)
      std::copy_n(&image.data[p * source_channels], channels, pixels + p * channels);
  }
  for (std::size_t p = 0; channels == 4 && p < mask.used.size(); ++p) {
    if (!mask.Uses(p)) pixels[p * channels + 3] = 255;
  }
}

}  // namespace

Dataset LoadDataset(const io::Scene& scene, int threads, double pixel_offset) {
  const std::size_t n = scene.frames.size();
  if (n == 0) throw Error(ExitCode::kBadInput, "the scene has no pictures");
  const auto camera_of = [&](const io::Frame& frame) -> const io::Camera& {
    return scene.cameras[static_cast<std::size_t>(frame.camera_index)];
  };
  std::vector<io::Image> images(n);
  std::vector<io::Mask> masks(n);
  io::Workers(threads).Run(static_cast<int>(n), [&](int index, int) {
    const auto i = static_cast<std::size_t>(index);
    const io::Frame& frame = scene.frames[i];
    const io::Camera& camera = camera_of(frame);
    images[i] = ReadPicture(frame, camera);
    if (!frame.mask_path.empty()) masks[i] = io::ReadMask(frame.mask_path, camera.width, camera.height);
  });
  Dataset dataset;
  dataset.channels = HasAlpha(images) ? 4 : 3;
  std::size_t n_pixels = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const io::Frame& frame = scene.frames[i];
    if (dataset.channels == 4 && images[i].channels != 4) {
      throw Error(ExitCode::kBadInput,
                  frame.image_path.string() + ": has no alpha channel while other pictures do");
    }
    const RayCamera camera(camera_of(frame), frame.world_from_cam, pixel_offset);
    dataset.views.push_back(
        {frame.image_path.stem().string(), camera, images[i].width, images[i].height, n_pixels});
    n_pixels += static_cast<std::size_t>(images[i].width) * static_cast<std::size_t>(images[i].height);
  }
  dataset.pixels.resize(n_pixels * static_cast<std::size_t>(dataset.channels));
  for (std::size_t i = 0; i < n; ++i) {
    CopyPicture(images[i], masks[i], dataset.views[i].first_pixel, &dataset);
    images[i] = {};
  }
  dataset.runs = PixelRuns(UsedRuns(dataset.views, masks));
  return dataset;
}

}  // namespace nerf
