#include "nerf/splatting/tile_lists.h"

#include <algorithm>
#include <cmath>

namespace nerf {
namespace {

// The tiles between two places of the picture, in pixels: [begin, end) of n.
void SetRange(float low, float high, int n, std::uint16_t* begin, std::uint16_t* end) {
  const float side = kernels::kTileSide, most = static_cast<float>(n);
  *begin = static_cast<std::uint16_t>(std::clamp(std::floor(low / side), 0.f, most));
  *end = static_cast<std::uint16_t>(std::clamp(std::ceil(high / side), static_cast<float>(*begin), most));
}

// Calls visit(tile) for each tile of a splat, row by row.
template <typename Visit>
void ForEachTile(const PlacedSplat& placed, int tiles_across, const Visit& visit) {
  for (int y = placed.y_begin; y < placed.y_end; ++y) {
    for (int x = placed.x_begin; x < placed.x_end; ++x) visit(static_cast<std::size_t>(y * tiles_across + x));
  }
}

}  // namespace

void TileLists::SetTiles(int width, int height, PlacedSplat* placed) {
  const kernels::BlendedSplat& splat = placed->blended;
  SetRange(splat.x - splat.reach_x, splat.x + splat.reach_x, Across(width), &placed->x_begin, &placed->x_end);
  SetRange(
      splat.y - splat.reach_y, splat.y + splat.reach_y, Across(height), &placed->y_begin, &placed->y_end);
}

void TileLists::Build(int width, int height, const std::vector<PlacedSplat>& placed) {
  const int across = Across(width);
  begins_.assign(static_cast<std::size_t>(across * Across(height)) + 1, 0);
  first_slots_.resize(placed.size());
  std::uint32_t n_slots = 0;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    first_slots_[i] = n_slots;
    n_slots += placed[i].n_tiles();
    ForEachTile(placed[i], across, [&](std::size_t tile) { ++begins_[tile + 1]; });
  }
  for (std::size_t tile = 1; tile < begins_.size(); ++tile) begins_[tile] += begins_[tile - 1];
  filled_ = begins_;
  entries_.resize(n_slots);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    std::uint32_t slot = first_slots_[i];
    ForEachTile(placed[i], across, [&](std::size_t tile) {
      entries_[filled_[tile]++] = {placed[i].depth, static_cast<std::uint32_t>(i), slot++};
    });
  }
}

void TileLists::Sort(int tile) {
  const auto first = entries_.begin() + begins_[static_cast<std::size_t>(tile)],
             last = entries_.begin() + begins_[static_cast<std::size_t>(tile) + 1];
  std::sort(first, last, [](const Entry& a, const Entry& b) {
    return a.depth != b.depth ? a.depth < b.depth : a.splat < b.splat;
  });
}

}  // namespace nerf
