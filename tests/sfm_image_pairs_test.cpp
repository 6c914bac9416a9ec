#include "sfm/image_pairs.h"

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
// changed and in another order.
std::vector<sfm::Descriptors> Walk(int n) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> value(0, 1);
  const auto draw = [&](int rows) {
    return sfm::Descriptors::NullaryExpr(rows, 128, [&] { return value(random); }).eval();
  };
  const sfm::Descriptors wall = draw(20 * n + 100);
  std::vector<sfm::Descriptors> pictures;
  for (int i = 0; i < n; ++i) {
    sfm::Descriptors picture = (wall.middleRows(20 * i, 100) + 0.1f * draw(100)).colwise().reverse();
    picture.rowwise().normalize();
    pictures.push_back(picture);
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
  EXPECT_EQ(pairs, sfm::LikelyPairs(pictures, 4, 1));
}

TEST(ImagePairs, PicturesWithoutFeaturesHaveNoPartners) {
  std::vector<sfm::Descriptors> pictures = Walk(3);
  pictures[1].resize(0, 128);
  EXPECT_EQ(sfm::LikelyPairs(pictures, 4, 2), (sfm::ImagePairs{{0, 2}}));
}

}  // namespace
