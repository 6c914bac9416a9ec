// Where a large capture is cut, and what its parts have in common.
#include "sfm/mapping/capture_blocks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

namespace {

using Blocks = std::vector<std::vector<int>>;

// Every picture matches the `reach` that follow it; the nearest best.
std::vector<sfm::PictureLink> Walk(int first, int end, int reach) {
  std::vector<sfm::PictureLink> links;
  for (int a = first; a < end; ++a) {
    for (int b = a + 1; b < std::min(end, a + reach + 1); ++b) links.push_back({a, b, 300.0 / (b - a)});
  }
  return links;
}

std::vector<int> Shared(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> shared;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(shared));
  return shared;
}

TEST(CaptureBlocks, ASmallCaptureIsOneBlock) {
  EXPECT_EQ(sfm::OverlappingBlocks(5, Walk(0, 5, 2), {.pictures = 5}), (Blocks{{0, 1, 2, 3, 4}}));
}

TEST(CaptureBlocks, PicturesWithoutMatchesAreInNone) {
  EXPECT_EQ(sfm::OverlappingBlocks(6, Walk(1, 5, 2), {.pictures = 5}), (Blocks{{1, 2, 3, 4}}));
  EXPECT_TRUE(sfm::OverlappingBlocks(6, {}, {}).empty());
}

TEST(CaptureBlocks, AWalkIsCutIntoStretchesThatOverlap) {
  Blocks blocks = sfm::OverlappingBlocks(100, Walk(0, 100, 5), {.pictures = 30, .overlap = 0.3});
  std::sort(blocks.begin(), blocks.end());
  ASSERT_EQ(blocks.size(), 4u);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const std::vector<int>& block = blocks[i];
    EXPECT_EQ(block.back() - block.front() + 1, static_cast<int>(block.size())) << "a stretch";
    EXPECT_LE(block.size(), 39u);
    if (i > 0) {
      EXPECT_GE(Shared(blocks[i - 1], block).size(), 8u);
    }
  }
  EXPECT_EQ(blocks.front().front(), 0);
  EXPECT_EQ(blocks.back().back(), 99);
}

TEST(CaptureBlocks, TheOrderOfThePicturesDoesNotMatter) {
  std::vector<int> name(100);
  for (int i = 0; i < 100; ++i) name[static_cast<std::size_t>(i)] = i;
  std::shuffle(name.begin(), name.end(), std::mt19937(3));
  std::vector<sfm::PictureLink> links = Walk(0, 100, 5);
  std::vector<int> position(100);
  for (int i = 0; i < 100; ++i) position[static_cast<std::size_t>(name[static_cast<std::size_t>(i)])] = i;
  for (sfm::PictureLink& link : links) {
    link.a = name[static_cast<std::size_t>(link.a)];
    link.b = name[static_cast<std::size_t>(link.b)];
  }
  for (const std::vector<int>& block : sfm::OverlappingBlocks(100, links, {.pictures = 30, .overlap = 0.3})) {
    std::vector<int> places;
    for (const int picture : block) places.push_back(position[static_cast<std::size_t>(picture)]);
    std::sort(places.begin(), places.end());
    EXPECT_EQ(places.back() - places.front() + 1, static_cast<int>(places.size())) << "a stretch of the walk";
  }
}

TEST(CaptureBlocks, PartsWithoutCommonMatchesStayApart) {
  std::vector<sfm::PictureLink> links = Walk(0, 20, 3);
  for (const sfm::PictureLink& link : Walk(20, 50, 3)) links.push_back(link);
  std::set<int> seen;
  for (const std::vector<int>& block : sfm::OverlappingBlocks(50, links, {.pictures = 25, .overlap = 0.2})) {
    EXPECT_EQ(block.front() < 20, block.back() < 20);
    seen.insert(block.begin(), block.end());
  }
  EXPECT_EQ(seen.size(), 50u);
}

TEST(CaptureBlocks, AWeakLinkIsWhereTheCutGoes) {
  // Two places of 12 and 16 pictures, all of which match those of the same place, and one match between.
  std::vector<sfm::PictureLink> links = Walk(0, 12, 12);
  for (const sfm::PictureLink& link : Walk(12, 28, 16)) links.push_back(link);
  links.push_back({11, 12, 15});
  const Blocks blocks = sfm::OverlappingBlocks(28, links, {.pictures = 20, .overlap = 0});
  ASSERT_EQ(blocks.size(), 2u);
  EXPECT_EQ(std::min(blocks[0].size(), blocks[1].size()), 12u);
}

}  // namespace
