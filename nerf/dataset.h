// Posed pictures as rays and target colours: the only place where poses go from double to float.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/image.h"
#include "io/scene.h"

namespace nerf {

struct Ray {
  float origin[3], direction[3];  // unit direction, scene coordinates
};

// A pinhole camera in float, ready to shoot rays. Throws kBadInput for a camera with distortion.
class RayCamera {
 public:
  RayCamera(const io::Camera& camera, const io::Rigid3d& world_from_cam, double pixel_offset = 0.5);
  // Ray through (x + pixel_offset, y + pixel_offset), by default the centre of pixel (x, y), or dx and dy
  // pixels beside it.
  Ray RayThrough(int x, int y, float dx = 0, float dy = 0) const;

 private:
  float inv_fl_x_, inv_fl_y_, cx_, cy_;
  float rotation_[9], origin_[3];
};

// One of the cells of a pixel that is cut into a square number of them.
struct PixelCell {
  int column, row;
  float side;  // pixels
  // Offsets from the pixel's centre of the point at shares u and v of the cell's sides.
  float Dx(float u) const { return (static_cast<float>(column) + u) * side - 0.5f; }
  float Dy(float v) const { return (static_cast<float>(row) + v) * side - 0.5f; }
};
PixelCell CellOfPixel(int index, int n_cells);
// Whether a pixel can be cut into so many cells: 1, 4, 9 or 16.
inline bool IsPixelRays(int n) { return n == 1 || n == 4 || n == 9 || n == 16; }

struct View {
  std::string name;
  RayCamera camera;
  int width, height;
  std::size_t first_pixel;  // into Dataset::pixels, in pixels
};

// Used pixels without a gap. Ranks count the used pixels of all views.
struct PixelRun {
  std::uint32_t first_rank, first_pixel;
};

// The used pixels of all views. 8 bytes per run: a few kilobytes per picture, and never more than 4 bytes per
// pixel.
class PixelRuns {
 public:
  PixelRuns() = default;
  // By rising rank, and one more entry that ends the last.
  explicit PixelRuns(std::vector<PixelRun> runs);

  bool empty() const { return runs_.empty(); }
  std::size_t size() const { return runs_.empty() ? 0 : runs_.back().first_rank; }
  // The used pixel of a rank in [0, size).
  std::size_t Pixel(std::size_t rank) const {
    std::size_t run = run_of_block_[rank / kBlock];
    while (runs_[run + 1].first_rank <= rank) ++run;
    return runs_[run].first_pixel + (rank - runs_[run].first_rank);
  }

 private:
  static constexpr std::size_t kBlock = 64;  // ranks; most runs are longer
  std::vector<PixelRun> runs_;
  std::vector<std::uint32_t> run_of_block_;  // the run of its first rank
};

struct Dataset {
  std::vector<View> views;
  int channels = 3;                  // 3: RGB; 4: RGB + straight alpha (all views alike)
  std::vector<std::uint8_t> pixels;  // [n_pixels][channels]
  // sRGB in [0, 1] of a background that the pictures have in them: alpha then has the values of
  // plain_background.h.
  std::optional<std::array<float, 3>> background;
  PixelRuns runs;  // empty: every pixel is used
  std::size_t n_pixels() const { return pixels.size() / static_cast<std::size_t>(channels); }
  std::size_t n_used() const { return runs.empty() ? n_pixels() : runs.size(); }

  // The used pixel of a rank in [0, n_used).
  std::size_t UsedPixel(std::size_t rank) const { return runs.empty() ? rank : runs.Pixel(rank); }
  // Whether each pixel is used; empty: no view has a mask.
  std::vector<bool> UsedPixels() const;

  // The view a pixel belongs to.
  const View& ViewOf(std::size_t pixel) const;
};

// Reads the pictures of a scene and their masks. Pictures with and without alpha do not mix; alpha that is
// opaque everywhere is dropped; pixels that are not used are opaque, for nothing is known to be empty there.
// Throws kBadInput when a picture is missing or differs in size from its camera, or a mask from its picture.
Dataset LoadDataset(const io::Scene& scene, int threads, double pixel_offset = 0.5);

}  // namespace nerf
