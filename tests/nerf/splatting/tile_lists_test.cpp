// Every splat is listed in the tiles that it reaches, and nowhere else.
#include "nerf/splatting/tile_lists.h"

#include <gtest/gtest.h>

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
  TileLists lists;
  lists.Build(50, 40, placed);
  ASSERT_EQ(lists.n_tiles(), 12);
  EXPECT_EQ(lists.n_slots(), 1u + 4 + 12 + 1 + 3);
  const auto splats_of = [&](int tile) {
    lists.Sort(tile);
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

}  // namespace
}  // namespace nerf
