#include "sfm/features/image_pairs.h"
#include "sfm/features/likely_pairs.h"

#include <gtest/gtest.h>

#include <random>

namespace {

TEST(ImagePairs, AllAndSequential) {
  EXPECT_EQ(sfm::AllPairs(5).size(), 10u);
  EXPECT_EQ(sfm::AllPairs(1).size(), 0u);
  EXPECT_EQ(sfm::SequentialPairs(4, 1), (sfm::ImagePairs{{0, 1}, {1, 2}, {2, 3}}));
  EXPECT_EQ(sfm::SequentialPairs(100, 10).size(), 100u * 10 - 55);
}

// A walk of n pictures along a wall of random descriptors: picture i sees rows [20 i, 20 i + 100), slightly
// changed and in reverse order.
std::vector<sfm::Features> Walk(int n) {
  std::mt19937 random(3);
  std::vector<std::uint8_t> wall;
  for (int i = 0; i < (20 * n + 100) * sfm::kDescriptorBytes; ++i) wall.push_back(random() % 80);
  std::vector<sfm::Features> pictures(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    sfm::Features& picture = pictures[static_cast<std::size_t>(i)];
    for (int row = 20 * i + 99; row >= 20 * i; --row) {
      picture.keypoints.push_back({});
      for (int k = 0; k < sfm::kDescriptorBytes; ++k) {
        picture.descriptors.push_back(static_cast<std::uint8_t>(
            wall[static_cast<std::size_t>(row * sfm::kDescriptorBytes + k)] + random() % 4));
      }
    }
  }
  return pictures;
}

TEST(ImagePairs, LikelyPairsAreThoseThatOverlap) {
  const auto pictures = Walk(12);
  const sfm::ImagePairs pairs = sfm::LikelyPairs(pictures, 4, 2);
  for (const auto& [a, b] : pairs)
    EXPECT_LE(b - a, 4) << a << " " << b;  // 20 rows shared at distance 4, none at 5
  for (int i = 0; i + 1 < 12; ++i) EXPECT_EQ(pairs.count({i, i + 1}), 1u) << i;
  EXPECT_EQ(pairs.count({5, 7}), 1u);
  EXPECT_EQ(pairs.count({5, 8}), 0u);  // both share more with four others
  EXPECT_EQ(pairs, sfm::LikelyPairs(pictures, 4, 1));
}

TEST(ImagePairs, OnlyTheLargestFeaturesAreCompared) {
  // Of random rows; 384 are large. Pictures 0 and 1 share all small ones, 0 and 2 share 4 large ones, 0 and 3
  // share 3.
  std::mt19937 random(4);
  const auto rows = [&](int n) {
    std::vector<std::uint8_t> bytes;
    for (int i = 0; i < n * sfm::kDescriptorBytes; ++i) bytes.push_back(random() % 80);
    return bytes;
  };
  const std::vector<std::uint8_t> large = rows(384), small = rows(50);
  std::vector<sfm::Features> pictures(4);
  for (std::size_t i = 0; i < 4; ++i) {
    sfm::Features& picture = pictures[i];
    picture.descriptors = i < 2 ? small : rows(50);
    const int shared = i == 0 ? 384 : i == 1 ? 0 : i == 2 ? 4 : 3;
    picture.descriptors.insert(
        picture.descriptors.end(), large.begin(), large.begin() + shared * sfm::kDescriptorBytes);
    const std::vector<std::uint8_t> own = rows(384 - shared);
    picture.descriptors.insert(picture.descriptors.end(), own.begin(), own.end());
    for (int k = 0; k < 50 + 384; ++k) picture.keypoints.push_back({.scale = k < 50 ? 1.0f : 2.0f});
  }
  EXPECT_EQ(sfm::LikelyPairs(pictures, 4, 2), (sfm::ImagePairs{{0, 2}}));
}

TEST(ImagePairs, PicturesWithoutFeaturesHaveNoPartners) {
  std::vector<sfm::Features> pictures = Walk(3);
  pictures[1] = {};
  EXPECT_EQ(sfm::LikelyPairs(pictures, 4, 2), (sfm::ImagePairs{{0, 2}}));
}

}  // namespace
