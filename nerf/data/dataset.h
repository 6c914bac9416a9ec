// Posed pictures as rays and target colours.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/image/image.h"
#include "io/scene/scene.h"
#include "nerf/data/pixel_runs.h"
#include "nerf/sampling/ray.h"

namespace nerf {

struct View {
  std::string name;
  RayCamera camera;
  int width, height;
  std::size_t first_pixel;  // into Dataset::pixels, in pixels
  std::size_t n_pixels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
};

// Distance from a camera to what one point of its picture shows.
struct SparseDepth {
  std::size_t view, point;  // point: of the scene
  float x, y;               // pixels; the centre of the first one is at (0.5, 0.5)
  float t;                  // along the ray, scene units
};

struct Dataset {
  std::vector<View> views;
  int channels = 3;                  // 3: RGB; 4: RGB + straight alpha (all views alike)
  std::vector<std::uint8_t> pixels;  // [n_pixels][channels]
  // sRGB in [0, 1] of a background that the pictures have in them: alpha then has the values of
  // plain_background.h.
  std::optional<std::array<float, 3>> background;
  std::vector<SparseDepth> depths;  // of sparse points; may be empty
  PixelRuns runs;                   // empty: every pixel is used
  std::vector<bool> sky;            // [n_pixels], see sky.h; empty: no picture shows any
  std::size_t n_pixels() const { return pixels.size() / static_cast<std::size_t>(channels); }
  std::size_t n_used() const { return runs.empty() ? n_pixels() : runs.size(); }

  // The used pixel of a rank in [0, n_used).
  std::size_t UsedPixel(std::size_t rank) const { return runs.empty() ? rank : runs.Pixel(rank); }
  // Whether each pixel is used; empty: all are.
  std::vector<bool> UsedPixels() const;
  // The opposite.
  void Use(const std::vector<bool>& used);

  bool ShowsSky(std::size_t pixel) const { return !sky.empty() && sky[pixel]; }

  // The view a pixel belongs to.
  const View& ViewOf(std::size_t pixel) const;
  // The pixel that a depth lies in.
  std::size_t PixelOf(const SparseDepth& depth) const {
    const View& view = views[depth.view];
    return view.first_pixel +
           static_cast<std::size_t>(static_cast<int>(depth.y) * view.width + static_cast<int>(depth.x));
  }
};

// Reads the pictures of a scene and their masks. Pictures with and without alpha do not mix; alpha that is
// opaque everywhere is dropped; pixels that are not used are opaque, for nothing is known to be empty there.
// Throws kBadInput when a picture is missing or differs in size from its camera, or a mask from its picture,
// or when all have more than 2^32 pixels.
Dataset LoadDataset(const io::Scene& scene, int threads, double pixel_offset = 0.5);

// Of all pictures together, as their cameras have it.
std::size_t CountPixels(const io::Scene& scene);
// Channels of the first picture, as stored: 3 or 4.
int StoredChannels(const io::Scene& scene);

// Its views and the runs of used pixels, without reading a picture: `pixels` is empty.
Dataset LayOutDataset(const io::Scene& scene, int threads, double pixel_offset);
// Calls take(view, picture) for every picture, on several threads, so that no more than one per thread is in
// memory. Returns whether the pictures have alpha.
bool ReadPictures(const io::Scene& scene,
                  int threads,
                  const std::function<void(std::size_t view, const io::Image& picture)>& take);

}  // namespace nerf
