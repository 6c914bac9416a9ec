#include "nerf/splatting/tile_lists.h"

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>

namespace nerf {
namespace {

constexpr std::size_t kGatheredAtOnce = 8192;  // splats per task
// Depths are sorted by so many bits at a time.
constexpr int kDigitBits = 11, kDigits = 3;
constexpr std::size_t kDigitValues = std::size_t{1} << kDigitBits;

std::size_t Digit(std::uint32_t key, int digit) { return key >> (kDigitBits * digit) & (kDigitValues - 1); }

// The tiles between two places of the picture, in pixels: [begin, end) of n.
void SetRange(float low, float high, int n, std::uint16_t* begin, std::uint16_t* end) {
  constexpr float kTilesPerPixel = 1.f / kernels::kTileSide;  // a power of two: exact
  const float most = static_cast<float>(n);
  *begin = static_cast<std::uint16_t>(std::clamp(low * kTilesPerPixel, 0.f, most));
  const float last = std::clamp(high * kTilesPerPixel, static_cast<float>(*begin), most);
  *end = static_cast<std::uint16_t>(last);
  *end = static_cast<std::uint16_t>(*end + (static_cast<float>(*end) < last));
}

}  // namespace

void TileLists::SetTiles(int width, int height, PlacedSplat* placed) {
  const kernels::BlendedSplat& splat = placed->blended;
  SetRange(splat.x - splat.reach_x, splat.x + splat.reach_x, Across(width), &placed->x_begin, &placed->x_end);
  SetRange(
      splat.y - splat.reach_y, splat.y + splat.reach_y, Across(height), &placed->y_begin, &placed->y_end);
}

// The seen ones in the order of `placed`, in which they also get their slots.
void TileLists::Gather(const std::vector<PlacedSplat>& placed, io::Workers* workers) {
  struct Count {
    std::uint32_t splats = 0, slots = 0;
  };
  const std::size_t n_pieces = (placed.size() + kGatheredAtOnce - 1) / kGatheredAtOnce;
  std::vector<Count> before(n_pieces + 1);
  const auto for_each_seen = [&](const auto& visit) {
    workers->Run(static_cast<int>(n_pieces), [&](int index, int) {
      const auto piece = static_cast<std::size_t>(index);
      const std::size_t end = std::min(placed.size(), (piece + 1) * kGatheredAtOnce);
      for (std::size_t i = piece * kGatheredAtOnce; i < end; ++i)
        if (placed[i].n_tiles() > 0) visit(piece, i);
    });
  };
  for_each_seen([&](std::size_t piece, std::size_t i) {
    ++before[piece + 1].splats;
    before[piece + 1].slots += placed[i].n_tiles();
  });
  for (std::size_t piece = 1; piece <= n_pieces; ++piece) {
    before[piece].splats += before[piece - 1].splats;
    before[piece].slots += before[piece - 1].slots;
  }
  seen_.resize(before[n_pieces].splats);
  entries_.resize(before[n_pieces].slots);
  first_slots_.resize(placed.size());
  for_each_seen([&](std::size_t piece, std::size_t i) {
    const PlacedSplat& splat = placed[i];
    Count& at = before[piece];
    first_slots_[i] = at.slots;
    seen_[at.splats] = {.depth = std::bit_cast<std::uint32_t>(splat.depth),
                        .splat = static_cast<std::uint32_t>(i),
                        .slot = at.slots,
                        .x_begin = splat.x_begin,
                        .x_end = splat.x_end,
                        .y_begin = splat.y_begin,
                        .y_end = splat.y_end};
    ++at.splats, at.slots += splat.n_tiles();
  });
}

// Radix sort, which leaves equal ones in their order.
void TileLists::SortByDepth() {
  std::array<std::array<std::uint32_t, kDigitValues>, kDigits> places = {};
  for (const Seen& seen : seen_) {
    for (int digit = 0; digit < kDigits; ++digit)
      ++places[static_cast<std::size_t>(digit)][Digit(seen.depth, digit)];
  }
  spare_.resize(seen_.size());
  for (int digit = 0; digit < kDigits; ++digit) {
    std::array<std::uint32_t, kDigitValues>& place = places[static_cast<std::size_t>(digit)];
    std::exclusive_scan(place.begin(), place.end(), place.begin(), std::uint32_t{0});
    for (const Seen& seen : seen_) spare_[place[Digit(seen.depth, digit)]++] = seen;
    seen_.swap(spare_);
  }
}

// Calls visit(tile, seen splat, slot) for each tile of each splat: the splats of one tile in the order of
// seen_, tiles of different rows side by side.
template <typename Visit>
void TileLists::ForEachTile(int across, int down, io::Workers* workers, const Visit& visit) const {
  const int n_bands = std::min(workers->n_threads(), down);
  workers->Run(n_bands, [&](int band, int) {
    const int first_row = band * down / n_bands, end_row = (band + 1) * down / n_bands;
    for (const Seen& seen : seen_) {
      const int width = seen.x_end - seen.x_begin, y_end = std::min<int>(end_row, seen.y_end);
      for (int y = std::max<int>(first_row, seen.y_begin); y < y_end; ++y) {
        const auto tile = static_cast<std::size_t>(y * across + seen.x_begin);
        const auto slot = seen.slot + static_cast<std::uint32_t>((y - seen.y_begin) * width);
        for (int x = 0; x < width; ++x)
          visit(tile + static_cast<std::size_t>(x), seen, slot + static_cast<std::uint32_t>(x));
      }
    }
  });
}

void TileLists::Build(int width, int height, const std::vector<PlacedSplat>& placed, io::Workers* workers) {
  Gather(placed, workers);
  SortByDepth();
  const int across = Across(width), down = Across(height);
  begins_.assign(static_cast<std::size_t>(across * down) + 1, 0);
  ForEachTile(
      across, down, workers, [&](std::size_t tile, const Seen&, std::uint32_t) { ++begins_[tile + 1]; });
  std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
  filled_ = begins_;
  ForEachTile(across, down, workers, [&](std::size_t tile, const Seen& seen, std::uint32_t slot) {
    entries_[filled_[tile]++] = {seen.splat, slot};
  });
}

}  // namespace nerf
