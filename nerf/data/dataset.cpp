#include "nerf/data/dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/base/check.h"
#include "io/image/mask.h"
#include "io/process/parallel.h"

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

void Dataset::Use(const std::vector<bool>& used) {
  std::vector<PixelRun> begun;
  std::uint32_t rank = 0;
  for (std::size_t p = 0; p < used.size(); ++p) {
    if (used[p] && (p == 0 || !used[p - 1])) begun.push_back({rank, static_cast<std::uint32_t>(p)});
    rank += used[p];
  }
  begun.push_back({rank, static_cast<std::uint32_t>(used.size())});
  runs = used.empty() ? PixelRuns() : PixelRuns(std::move(begun));
}

namespace {

// Used pixels of one view without a gap, counted from its first: [first, last).
struct Stretch {
  std::uint32_t first, last;
};

std::vector<Stretch> StretchesOf(const io::Mask& mask, std::size_t n_pixels) {
  std::vector<Stretch> stretches;
  for (std::size_t p = 0; p < n_pixels; ++p) {
    if (!mask.Uses(p)) continue;
    if (p == 0 || !mask.Uses(p - 1)) stretches.push_back({static_cast<std::uint32_t>(p), 0});
    stretches.back().last = static_cast<std::uint32_t>(p + 1);
  }
  return stretches;
}

std::vector<PixelRun> RunsOf(const std::vector<View>& views, const std::vector<std::vector<Stretch>>& used) {
  std::vector<PixelRun> runs;
  std::uint32_t rank = 0;
  std::size_t n_pixels = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (const Stretch& stretch : used[i]) {
      runs.push_back({rank, static_cast<std::uint32_t>(views[i].first_pixel + stretch.first)});
      rank += stretch.last - stretch.first;
    }
    n_pixels = views[i].first_pixel + views[i].n_pixels();
  }
  runs.push_back({rank, static_cast<std::uint32_t>(n_pixels)});
  return runs;
}

const io::Camera& CameraOf(const io::Scene& scene, const io::Frame& frame) {
  return scene.cameras[static_cast<std::size_t>(frame.camera_index)];
}

io::Image ReadPicture(const io::Scene& scene, const io::Frame& frame) {
  const io::Camera& camera = CameraOf(scene, frame);
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

bool HasAlpha(const io::Image& image) {
  for (std::size_t p = 3; image.channels == 4 && p < image.data.size(); p += 4) {
    if (image.data[p] != 255) return true;
  }
  return false;
}

// Copies pixels of one number of channels to those of another; alpha that is new is opaque.
void CopyPixels(const std::uint8_t* from, int from_channels, std::size_t n, std::uint8_t* to, int channels) {
  const std::size_t common = static_cast<std::size_t>(std::min(from_channels, channels));
  for (std::size_t p = 0; p < n; ++p, from += from_channels, to += channels) {
    std::copy_n(from, common, to);
    if (channels > from_channels) to[3] = 255;
  }
}

}  // namespace

Dataset LayOutDataset(const io::Scene& scene, int threads, double pixel_offset) {
  if (scene.frames.empty()) throw Error(ExitCode::kBadInput, "the scene has no pictures");
  Dataset dataset;
  std::size_t n_pixels = 0;
  bool has_masks = false;
  for (const io::Frame& frame : scene.frames) {
    const io::Camera& camera = CameraOf(scene, frame);
    dataset.views.push_back({frame.image_path.stem().string(),
                             RayCamera(camera, frame.world_from_cam, pixel_offset),
                             camera.width,
                             camera.height,
                             n_pixels});
    n_pixels += dataset.views.back().n_pixels();
    has_masks |= !frame.mask_path.empty();
  }
  if (n_pixels > UINT32_MAX)
    throw Error(
        ExitCode::kBadInput,
        fmt::format(
            "the pictures have {} million pixels; the limit is {}", n_pixels / 1000000, UINT32_MAX / 1000000),
        "Use a smaller --image-size of pipeline normalize");
  if (!has_masks) return dataset;
  std::vector<std::vector<Stretch>> used(scene.frames.size());
  io::Workers(threads).Run(static_cast<int>(used.size()), [&](int index, int) {
    const auto i = static_cast<std::size_t>(index);
    const View& view = dataset.views[i];
    const std::filesystem::path& path = scene.frames[i].mask_path;
    used[i] =
        StretchesOf(path.empty() ? io::Mask{} : io::ReadMask(path, view.width, view.height), view.n_pixels());
  });
  dataset.runs = PixelRuns(RunsOf(dataset.views, used));
  return dataset;
}

bool ReadPictures(const io::Scene& scene,
                  int threads,
                  const std::function<void(std::size_t view, const io::Image&)>& take) {
  const std::size_t n = scene.frames.size();
  std::vector<std::uint8_t> has_alpha(n), has_channel(n);
  io::Workers(threads).Run(static_cast<int>(n), [&](int index, int) {
    const auto i = static_cast<std::size_t>(index);
    const io::Image image = ReadPicture(scene, scene.frames[i]);
    has_channel[i] = image.channels == 4;
    has_alpha[i] = HasAlpha(image);
    take(i, image);
  });
  if (std::count(has_alpha.begin(), has_alpha.end(), 1) == 0) return false;
  const auto lacking = std::find(has_channel.begin(), has_channel.end(), 0);
  if (lacking == has_channel.end()) return true;
  const io::Frame& frame = scene.frames[static_cast<std::size_t>(lacking - has_channel.begin())];
  throw Error(ExitCode::kBadInput,
              frame.image_path.string() + ": has no alpha channel while other pictures do");
}

std::size_t CountPixels(const io::Scene& scene) {
  std::size_t n_pixels = 0;
  for (const io::Frame& frame : scene.frames) {
    const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    n_pixels += static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  }
  return n_pixels;
}

int StoredChannels(const io::Scene& scene) {
  if (scene.frames.empty()) throw Error(ExitCode::kBadInput, "the scene has no pictures");
  return ReadPicture(scene, scene.frames[0]).channels;
}

Dataset LoadDataset(const io::Scene& scene, int threads, double pixel_offset) {
  Dataset dataset = LayOutDataset(scene, threads, pixel_offset);
  const View& last = dataset.views.back();
  const std::size_t n_pixels = last.first_pixel + last.n_pixels();
  // Pictures go to their final place at once: together they may fill most of the memory.
  dataset.channels = StoredChannels(scene);
  dataset.pixels.resize(n_pixels * static_cast<std::size_t>(dataset.channels));
  const bool has_alpha = ReadPictures(scene, threads, [&](std::size_t i, const io::Image& image) {
    const View& view = dataset.views[i];
    CopyPixels(image.data.data(),
               image.channels,
               view.n_pixels(),
               &dataset.pixels[view.first_pixel * static_cast<std::size_t>(dataset.channels)],
               dataset.channels);
  });
  if (dataset.channels == 4 && !has_alpha) {
    CopyPixels(dataset.pixels.data(), 4, n_pixels, dataset.pixels.data(), 3);
    dataset.channels = 3;
    dataset.pixels.resize(n_pixels * 3);
  }
  const std::vector<bool> used = dataset.UsedPixels();
  for (std::size_t p = 0; dataset.channels == 4 && p < used.size(); ++p) {
    if (!used[p]) dataset.pixels[4 * p + 3] = 255;
  }
  return dataset;
}

}  // namespace nerf
