// Pictures of splats on the blending kernels, and the gradient of their difference from a target: splats are
// projected, listed by tile, sorted by depth and blended front to back (Kerbl et al. 2023).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "io/process/parallel.h"
#include "nerf/splatting/splats.h"
#include "nerf/splatting/tile_lists.h"

namespace nerf {

// What a view of the splats should look like.
struct SplatTarget {
  SplatView view;
  std::vector<std::uint8_t> rgba;  // [height][width][4], sRGB times opacity, and opacity
  std::vector<bool> used;          // [height][width]; empty: every pixel
};

// What the loss has besides the squared difference.
struct SplatLossWeights {
  float structure = 0;  // of 1 - SSIM (block_ssim.h), the mean over the picture's pixels and channels
  float opacity = 0;    // of the mean opacity of all splats, where pixels depend on them: hidden ones stay
};

struct SplatPicture {
  std::vector<float> rgb;            // [height][width][3], sRGB in front of black
  std::vector<float> transmittance;  // [height][width]
};

// Reuses its memory from picture to picture. Results are the same for any number of threads.
class SplatRasteriser {
 public:
  // workers must outlive this.
  explicit SplatRasteriser(io::Workers* workers) : workers_(workers) {}

  SplatPicture Render(const Splats& splats, const SplatView& view);

  // The mean over the picture's pixels, where unused ones add nothing, and channels of the squared difference
  // before a background of sRGB in [0, 1]; and the gradient of that and of what `weights` adds: rows of
  // splats that the view does not see are left as they are.
  double Gradient(const Splats& splats,
                  const SplatTarget& target,
                  const std::array<float, 3>& background,
                  const SplatLossWeights& weights,
                  Splats* gradient);

 private:
  struct Tile;
  void Place(const Splats& splats, const SplatView& view);
  void BlendTile(int index, const io::Camera& camera, Tile* tile);
  // Fills the slots of a blended tile and returns its sum of squared differences.
  double PullBackTile(int index,
                      const SplatTarget& target,
                      const std::array<float, 3>& background,
                      float structure_weight,
                      Tile* tile);
  void PullBackSplats(const Splats& splats, float opacity_weight, Splats* gradient);
  kernels::BlendedSplatGradient SumOfSlots(std::size_t splat) const;

  io::Workers* workers_;
  kernels::SplatCamera camera_ = {};
  std::vector<PlacedSplat> placed_;
  TileLists lists_;
  std::vector<kernels::BlendedSplatGradient> slots_;
};

}  // namespace nerf
