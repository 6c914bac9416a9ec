#include "nerf/splatting/splat_rasteriser.h"

#include <algorithm>
#include <numeric>

#include "nerf/kernels/kernels.h"
#include "nerf/splatting/block_ssim.h"

namespace nerf {
namespace {

using kernels::kTilePixels;
using kernels::kTileSide;

constexpr int kSplatsPerPiece = 2048;
// Splats that the projection is given at once.
constexpr std::size_t kProjectedAtOnce = 128;

// Calls work(begin, end) on pieces of n whose size does not depend on the threads.
template <typename Work>
void ForEachPiece(io::Workers* workers, std::size_t n, const Work& work) {
  const auto tasks = static_cast<int>((n + kSplatsPerPiece - 1) / kSplatsPerPiece);
  workers->Run(tasks, [&](int task, int) {
    const std::size_t begin = static_cast<std::size_t>(task) * kSplatsPerPiece;
    work(begin, std::min(n, begin + kSplatsPerPiece));
  });
}

kernels::SplatArrays<const float> ArraysOf(const Splats& splats) {
  return {splats.places.data(),
          splats.log_scales.data(),
          splats.rotations.data(),
          splats.opacities.data(),
          splats.colours.data()};
}

void Add(const kernels::BlendedSplatGradient& from, kernels::BlendedSplatGradient* sum) {
  sum->x += from.x, sum->y += from.y, sum->opacity += from.opacity;
  sum->a += from.a, sum->b += from.b, sum->c += from.c;
  for (int i = 0; i < 3; ++i) sum->rgb[i] += from.rgb[i];
}

}  // namespace

struct SplatRasteriser::Tile {
  int x = 0, y = 0, x_end = 0, y_end = 0;  // pixels [x, x_end) x [y, y_end) of the picture
  std::vector<kernels::BlendedSplat> splats;
  std::vector<kernels::BlendedSplatGradient> gradients;
  alignas(64) float rgb[3 * kTilePixels];
  alignas(64) float transmittance[kTilePixels];

  // Calls visit(pixel of the picture, pixel of the tile).
  template <typename Visit>
  void ForEachPixel(int width, const Visit& visit) const {
    for (int v = y; v < y_end; ++v) {
      for (int u = x; u < x_end; ++u)
        visit(static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u),
              (v - y) * kTileSide + u - x);
    }
  }
};

void SplatRasteriser::Place(const Splats& splats, const SplatView& view) {
  placed_.resize(splats.size());
  camera_ = CameraOf(view);
  const kernels::SplatArrays<const float> arrays = ArraysOf(splats);
  ForEachPiece(workers_, splats.size(), [&](std::size_t begin, std::size_t end) {
    kernels::BlendedSplat blended[kProjectedAtOnce];
    float depths[kProjectedAtOnce];
    for (std::size_t first = begin; first < end; first += kProjectedAtOnce) {
      const std::size_t n = std::min(kProjectedAtOnce, end - first);
      kernels::ActiveKernels().project_splats(
          camera_, arrays, static_cast<int>(first), static_cast<int>(n), blended, depths);
      for (std::size_t i = 0; i < n; ++i) {
        PlacedSplat& placed = placed_[first + i];
        placed = {};
        if (depths[i] == 0) continue;
        placed.blended = blended[i], placed.depth = depths[i];
        TileLists::SetTiles(view.camera.width, view.camera.height, &placed);
      }
    }
  });
  lists_.Build(view.camera.width, view.camera.height, placed_, workers_);
}

void SplatRasteriser::BlendTile(int index, const io::Camera& camera, Tile* tile) {
  const int across = TileLists::Across(camera.width);
  tile->x = index % across * kTileSide, tile->y = index / across * kTileSide;
  tile->x_end = std::min(camera.width, tile->x + kTileSide);
  tile->y_end = std::min(camera.height, tile->y + kTileSide);
  tile->splats.clear();
  for (const TileLists::Entry* entry = lists_.begin(index); entry != lists_.end(index); ++entry)
    tile->splats.push_back(placed_[entry->splat].blended);
  std::fill_n(tile->rgb, 3 * kTilePixels, 0.f);
  std::fill_n(tile->transmittance, kTilePixels, 1.f);
  kernels::ActiveKernels().blend_splats(tile->splats.data(),
                                        static_cast<int>(tile->splats.size()),
                                        tile->x,
                                        tile->y,
                                        tile->rgb,
                                        tile->transmittance);
}

SplatPicture SplatRasteriser::Render(const Splats& splats, const SplatView& view) {
  const io::Camera& camera = view.camera;
  Place(splats, view);
  const std::size_t n = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  SplatPicture picture{.rgb = std::vector<float>(3 * n), .transmittance = std::vector<float>(n)};
  std::vector<Tile> tiles(static_cast<std::size_t>(workers_->n_threads()));
  workers_->Run(lists_.n_tiles(), [&](int index, int thread) {
    Tile& tile = tiles[static_cast<std::size_t>(thread)];
    BlendTile(index, camera, &tile);
    tile.ForEachPixel(camera.width, [&](std::size_t pixel, int at) {
      for (std::size_t c = 0; c < 3; ++c)
        picture.rgb[3 * pixel + c] = tile.rgb[static_cast<int>(c) * kTilePixels + at];
      picture.transmittance[pixel] = tile.transmittance[at];
    });
  });
  return picture;
}

double SplatRasteriser::PullBackTile(int index,
                                     const SplatTarget& target,
                                     const std::array<float, 3>& background,
                                     float structure_weight,
                                     Tile* tile) {
  const io::Camera& camera = target.view.camera;
  const float share = 1 / (3 * static_cast<float>(camera.width) * static_cast<float>(camera.height));
  float shown[3 * kTilePixels], wanted[3 * kTilePixels], rgb_gradient[3 * kTilePixels] = {},
                                                                          to_come[kTilePixels] = {};
  bool counts[kTilePixels] = {};
  double squares = 0;
  tile->ForEachPixel(camera.width, [&](std::size_t pixel, int at) {
    if (!target.used.empty() && !target.used[pixel]) return;
    counts[at] = true;
    const std::uint8_t* rgba = &target.rgba[4 * pixel];
    const float free = 1 - static_cast<float>(rgba[3]) / 255;
    for (int c = 0; c < 3; ++c) {
      const int i = c * kTilePixels + at;
      const float behind = background[static_cast<std::size_t>(c)];
      shown[i] = tile->rgb[i] + tile->transmittance[at] * behind;
      wanted[i] = static_cast<float>(rgba[c]) / 255 + free * behind;
      const float difference = shown[i] - wanted[i];
      squares += static_cast<double>(difference) * static_cast<double>(difference);
      rgb_gradient[i] = 2 * share * difference;
    }
  });
  for (int c = 0; c < 3; ++c) {
    const int first = c * kTilePixels;
    float* gradient = rgb_gradient + first;
    AddBlockSsimGradient(shown + first, wanted + first, counts, share * structure_weight, gradient);
    for (int at = 0; at < kTilePixels; ++at)
      if (counts[at]) to_come[at] += gradient[at] * shown[first + at];
  }
  tile->gradients.resize(tile->splats.size());
  kernels::ActiveKernels().blend_splats_gradient(tile->splats.data(),
                                                 static_cast<int>(tile->splats.size()),
                                                 tile->x,
                                                 tile->y,
                                                 rgb_gradient,
                                                 to_come,
                                                 tile->gradients.data());
  const TileLists::Entry* entry = lists_.begin(index);
  for (std::size_t i = 0; i < tile->gradients.size(); ++i) slots_[entry[i].slot] = tile->gradients[i];
  return squares;
}

// Over the tiles of a splat that is seen.
kernels::BlendedSplatGradient SplatRasteriser::SumOfSlots(std::size_t splat) const {
  const std::uint32_t first = lists_.FirstSlot(splat), end = first + placed_[splat].n_tiles();
  kernels::BlendedSplatGradient sum = slots_[first];
  for (std::uint32_t slot = first + 1; slot < end; ++slot) Add(slots_[slot], &sum);
  return sum;
}

void SplatRasteriser::PullBackSplats(const Splats& splats, float opacity_weight, Splats* gradient) {
  const float by_opacity = opacity_weight / static_cast<float>(splats.size());
  const kernels::SplatArrays<const float> arrays = ArraysOf(splats);
  const kernels::SplatArrays<float> gradients = {gradient->places.data(),
                                                 gradient->log_scales.data(),
                                                 gradient->rotations.data(),
                                                 gradient->opacities.data(),
                                                 gradient->colours.data()};
  ForEachPiece(workers_, splats.size(), [&](std::size_t begin, std::size_t end) {
    std::uint32_t seen[kProjectedAtOnce];
    kernels::BlendedSplatGradient sums[kProjectedAtOnce];
    std::size_t n = 0;
    const auto pull_back = [&] {
      kernels::ActiveKernels().project_splats_gradient(
          camera_, arrays, seen, static_cast<int>(n), sums, gradients);
      n = 0;
    };
    for (std::size_t i = begin; i < end; ++i) {
      if (placed_[i].n_tiles() == 0) continue;
      sums[n] = SumOfSlots(i);
      if (sums[n].opacity != 0) sums[n].opacity += by_opacity;
      seen[n++] = static_cast<std::uint32_t>(i);
      if (n == kProjectedAtOnce) pull_back();
    }
    if (n > 0) pull_back();
  });
}

double SplatRasteriser::Gradient(const Splats& splats,
                                 const SplatTarget& target,
                                 const std::array<float, 3>& background,
                                 const SplatLossWeights& weights,
                                 Splats* gradient) {
  const io::Camera& camera = target.view.camera;
  Place(splats, target.view);
  slots_.resize(lists_.n_slots());
  std::vector<double> squares(static_cast<std::size_t>(lists_.n_tiles()));
  std::vector<Tile> tiles(static_cast<std::size_t>(workers_->n_threads()));
  workers_->Run(lists_.n_tiles(), [&](int index, int thread) {
    Tile& tile = tiles[static_cast<std::size_t>(thread)];
    BlendTile(index, camera, &tile);
    squares[static_cast<std::size_t>(index)] =
        PullBackTile(index, target, background, weights.structure, &tile);
  });
  PullBackSplats(splats, weights.opacity, gradient);
  return std::accumulate(squares.begin(), squares.end(), 0.0) / (3.0 * camera.width * camera.height);
}

}  // namespace nerf
