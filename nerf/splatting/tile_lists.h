// Which splats each tile of a picture has to blend.
#pragma once

#include <cstdint>
#include <vector>

#include "io/process/parallel.h"
#include "nerf/kernels/splat_blending.h"

namespace nerf {

// A splat as a view sees it. Tiles [x_begin, x_end) x [y_begin, y_end); none: it is not seen.
struct PlacedSplat {
  kernels::BlendedSplat blended = {};
  float depth = 0;  // > 0 where it is seen
  std::uint16_t x_begin = 0, x_end = 0, y_begin = 0, y_end = 0;

  std::uint32_t n_tiles() const {
    return static_cast<std::uint32_t>(x_end - x_begin) * static_cast<std::uint32_t>(y_end - y_begin);
  }
};

// All seen splats are sorted at once, then dealt out to the tiles in that order.
class TileLists {
 public:
  struct Entry {
    std::uint32_t splat;
    std::uint32_t slot;  // those of one splat follow one another, in the order of its tiles
  };

  // Sets the tiles that placed->blended reaches in a picture of width x height pixels.
  static void SetTiles(int width, int height, PlacedSplat* placed);
  static int Across(int pixels) { return (pixels + kernels::kTileSide - 1) / kernels::kTileSide; }

  // The same lists for any number of threads.
  void Build(int width, int height, const std::vector<PlacedSplat>& placed, io::Workers* workers);

  int n_tiles() const { return static_cast<int>(begins_.size()) - 1; }
  std::size_t n_slots() const { return entries_.size(); }
  // Of a splat that is seen.
  std::uint32_t FirstSlot(std::size_t splat) const { return first_slots_[splat]; }
  // Those of one tile by depth, nearest first; of equal ones the first splat.
  const Entry* begin(int tile) const { return entries_.data() + begins_[static_cast<std::size_t>(tile)]; }
  const Entry* end(int tile) const { return entries_.data() + begins_[static_cast<std::size_t>(tile) + 1]; }

 private:
  struct Seen {
    std::uint32_t depth;  // its bits, which order positive numbers as their values do
    std::uint32_t splat, slot;
    std::uint16_t x_begin, x_end, y_begin, y_end;
  };
  void Gather(const std::vector<PlacedSplat>& placed, io::Workers* workers);
  void SortByDepth();
  template <typename Visit>
  void ForEachTile(int across, int down, io::Workers* workers, const Visit& visit) const;

  std::vector<Seen> seen_, spare_;
  std::vector<std::uint32_t> begins_, first_slots_, filled_;
  std::vector<Entry> entries_;
};

}  // namespace nerf
