// Every splat is listed in the tiles that it reaches, and nowhere else.
#include "nerf/splatting/tile_lists.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "io/base/random.h"

namespace nerf {
namespace {

PlacedSplat SplatAt(float x, float y, float reach, float depth) {
  PlacedSplat placed{.blended = {.x = x, .y = y, .reach_x = reach, .reach_y = reach}, .depth = depth};
  TileLists::SetTiles(50, 40, &placed);  // 4 x 3 tiles
  return placed;
}

TEST(TileLists, HoldWhatReachesATileNearestFirst) {
  const std::vector<PlacedSplat> placed = {SplatAt(8, 8, 3, 5),      // tile 0
                                           SplatAt(16, 16, 2, 4),    // tiles 0, 1, 4, 5
                                           {},                       // none
                                           SplatAt(-20, 8, 10, 1),   // beside the picture
                                           SplatAt(25, 20, 100, 9),  // all
                                           SplatAt(8, 8, 3, 4),      // tile 0, as far as the second
                                           SplatAt(75, 20, 25, 2)};  // the last column
  io::Workers workers(2);
  TileLists lists;
  lists.Build(50, 40, placed, &workers);
  ASSERT_EQ(lists.n_tiles(), 12);
  EXPECT_EQ(lists.n_slots(), 1u + 4 + 12 + 1 + 3);
  const auto splats_of = [&](int tile) {
    std::vector<std::uint32_t> splats;
    for (const TileLists::Entry* entry = lists.begin(tile); entry != lists.end(tile); ++entry) {
      splats.push_back(entry->splat);
      const std::uint32_t first = lists.FirstSlot(entry->splat);
      EXPECT_GE(entry->slot, first);
      EXPECT_LT(entry->slot, first + placed[entry->splat].n_tiles());
    }
    return splats;
  };
  using List = std::vector<std::uint32_t>;
  EXPECT_EQ(splats_of(0), (List{1, 5, 0, 4}));
  EXPECT_EQ(splats_of(5), (List{1, 4}));
  EXPECT_EQ(splats_of(7), (List{6, 4}));
  EXPECT_EQ(splats_of(10), (List{4}));
}

// Depths of all magnitudes, some of them equal, against a sort by comparison.
TEST(TileLists, AreTheSameForAnyNumberOfThreads) {
  std::vector<PlacedSplat> placed;
  io::Random random(3, io::Stream::kInit, 0, 0);
  for (int i = 0; i < 20000; ++i) {
    const float x = 50 * random.Uniform(), y = 40 * random.Uniform(), reach = 20 * random.Uniform();
    const float depth = 0.2f * std::exp(16 * random.Uniform());
    placed.push_back(SplatAt(x, y, reach, i % 3 == 0 ? std::round(depth) + 1 : depth));
  }
  std::vector<std::uint32_t> by_depth(placed.size());
  std::iota(by_depth.begin(), by_depth.end(), 0);
  std::stable_sort(by_depth.begin(), by_depth.end(), [&](std::uint32_t a, std::uint32_t b) {
    return placed[a].depth < placed[b].depth;
  });
  for (const int threads : {1, 2, 5}) {
    io::Workers workers(threads);
    TileLists lists;
    lists.Build(50, 40, placed, &workers);
    for (int tile = 0; tile < lists.n_tiles(); ++tile) {
      const TileLists::Entry* entry = lists.begin(tile);
      for (const std::uint32_t splat : by_depth) {
        const PlacedSplat& at = placed[splat];
        const int x = tile % 4, y = tile / 4;
        if (x < at.x_begin || x >= at.x_end || y < at.y_begin || y >= at.y_end) continue;
        ASSERT_NE(entry, lists.end(tile));
        ASSERT_EQ(entry->splat, splat);
        ASSERT_EQ(entry->slot,
                  lists.FirstSlot(splat) + static_cast<std::uint32_t>(
                                               (y - at.y_begin) * (at.x_end - at.x_begin) + x - at.x_begin));
        ++entry;
      }
      ASSERT_EQ(entry, lists.end(tile));
    }
  }
}

}  // namespace
}  // namespace nerf
