// Which descriptors are called a match, and what is removed as standing still.
#include "sfm/features/matching.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "io/base/memory.h"
#include "sfm/features/stationary_matches.h"

namespace {

using Match = std::array<int, 2>;

// A descriptor of length 512 with two entries, at this angle between dimensions `first` and `first` + 1.
void Append(sfm::Features* features, int first, double degrees) {
  std::vector<std::uint8_t> row(sfm::kDescriptorBytes, 0);
  std::uint8_t* entries = &row[static_cast<std::size_t>(16 * first)];
  // 8 equal dimensions per direction: single ones would exceed a byte.
  for (int k = 0; k < 8; ++k) {
    entries[k] =
        static_cast<std::uint8_t>(std::lround(512 / std::sqrt(8.0) * std::cos(degrees / 180 * M_PI)));
    entries[8 + k] =
        static_cast<std::uint8_t>(std::lround(512 / std::sqrt(8.0) * std::sin(degrees / 180 * M_PI)));
  }
  features->descriptors.insert(features->descriptors.end(), row.begin(), row.end());
  features->keypoints.push_back({});
}

// Matches of pictures in which a's i-th feature meets those of b at the i-th list of angles.
std::vector<Match> MatchesAt(const std::vector<std::vector<double>>& degrees) {
  sfm::Features a, b;
  for (int i = 0; i < static_cast<int>(degrees.size()); ++i) {
    Append(&a, i, 0);
    for (const double angle : degrees[static_cast<std::size_t>(i)]) Append(&b, i, angle);
  }
  return sfm::MatchFeatures({a, b}, {{0, 1}}, 1)[0].matches;
}

TEST(Matching, MutualDistinctAndNear) {
  sfm::Features a, b;
  Append(&a, 0, 0);   // 0: nearest is b0 at 4 degrees, second b1 at 30
  Append(&a, 1, 0);   // 1: b2 at 10 and b3 at 11 degrees are hard to tell apart
  Append(&a, 2, 0);   // 2: b4 is mutual but 60 degrees away
  Append(&a, 3, 0);   // 3: nearest is b5, but b5 is nearer to a4
  Append(&a, 3, 30);  // 4
  Append(&b, 0, 4);
  Append(&b, 0, 30);
  Append(&b, 1, 10);
  Append(&b, 1, 11);
  Append(&b, 2, 60);
  Append(&b, 3, 29);
  const auto pairs = sfm::MatchFeatures({a, b}, {{0, 1}}, 2);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0].matches, (std::vector<Match>{{0, 0}, {4, 5}}));
}

// More pictures than are prepared together: pairs within and between blocks, in the order of the pairs.
TEST(Matching, BlocksOfPicturesAgreeWithPairsOnTheirOwn) {
  std::vector<sfm::Features> features(150);
  for (int i = 0; i < 150; ++i) {
    for (int k = 0; k < 3; ++k) Append(&features[static_cast<std::size_t>(i)], (i + k) % 7, 3.0 * (i % 4));
  }
  sfm::ImagePairs pairs;
  for (int i = 0; i < 150; i += 3) {
    for (const int gap : {1, 40, 64, 128}) {
      if (i + gap < 150) pairs.insert({i, i + gap});
    }
  }
  const auto matched = sfm::MatchFeatures(features, pairs, 2);
  ASSERT_EQ(matched.size(), pairs.size());
  std::size_t at = 0, n_matches = 0;
  for (const auto& [a, b] : pairs) {
    const sfm::PairMatches& pair = matched[at++];
    EXPECT_EQ(pair.a, a);
    EXPECT_EQ(pair.b, b);
    const auto alone = sfm::MatchFeatures(
        {features[static_cast<std::size_t>(a)], features[static_cast<std::size_t>(b)]}, {{0, 1}}, 1);
    EXPECT_EQ(pair.matches, alone[0].matches) << a << ' ' << b;
    n_matches += pair.matches.size();
  }
  EXPECT_GT(n_matches, pairs.size() / 2);
}

// A thousand pictures have half a million pairs.
TEST(Matching, APairKeepsItsMatchesAndNoOtherMemory) {
  std::vector<sfm::Features> features(200);
  for (std::size_t i = 0; i < features.size(); ++i) {
    for (int k = 0; k < 7; ++k) Append(&features[i], k, static_cast<double>(i % 3));
  }
  const std::size_t before = io::HeldMemoryBytes();
  const auto matched = sfm::MatchFeatures(features, sfm::AllPairs(200), 2);
  ASSERT_EQ(matched.size(), 19900u);
  EXPECT_LT(io::HeldMemoryBytes(), before + (std::size_t{40} << 20));
}

TEST(Matching, TheSecondMustBeAQuarterFarther) {
  EXPECT_EQ(MatchesAt({{10, 13.4}, {10, 11.8}}), (std::vector<Match>{{0, 0}}));  // ratios 0.75 and 0.85
}

TEST(Matching, FortyDegreesAreTheLimit) { EXPECT_EQ(MatchesAt({{39}, {42}}), (std::vector<Match>{{0, 0}})); }

TEST(Matching, TheRatioTestHoldsFromBothSides) {
  sfm::Features a, b;
  Append(&a, 0, 0);
  Append(&a, 0, 10.5);  // b0 is 5 and 5.5 degrees from them: clear for neither
  Append(&b, 0, 5);
  EXPECT_TRUE(sfm::MatchFeatures({a, b}, {{0, 1}}, 1)[0].matches.empty());
  EXPECT_TRUE(sfm::MatchFeatures({b, a}, {{0, 1}}, 1)[0].matches.empty());
}

TEST(Matching, PicturesWithoutFeaturesAndTheOrderOfPairs) {
  sfm::Features a;
  Append(&a, 0, 0);
  const auto pairs = sfm::MatchFeatures({a, {}, a}, {{0, 1}, {0, 2}, {1, 2}}, 3);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_TRUE(pairs[0].matches.empty());
  EXPECT_EQ(pairs[1].matches, (std::vector<Match>{{0, 0}}));
  EXPECT_EQ(pairs[1].a, 0);
  EXPECT_EQ(pairs[1].b, 2);
  EXPECT_TRUE(pairs[2].matches.empty());
}

// n pictures of 40 + 40 points: the first 40 move by `step` px from picture to picture, the others stay.
std::vector<sfm::Features> Turntable(int n, float step) {
  std::vector<sfm::Features> features(static_cast<std::size_t>(n));
  for (std::size_t i = 0; i < features.size(); ++i) {
    for (int k = 0; k < 80; ++k) {
      features[i].keypoints.push_back(
          {.x = static_cast<float>(10 * k) + (k < 40 ? step * static_cast<float>(i) : 0), .y = 5});
    }
  }
  return features;
}

std::vector<sfm::PairMatches> AllMatches(int n) {
  std::vector<sfm::PairMatches> pairs;
  for (const auto& [a, b] : sfm::AllPairs(n)) {
    pairs.push_back({.a = a, .b = b});
    for (int k = 0; k < 80; ++k) pairs.back().matches.push_back({k, k});
  }
  return pairs;
}

TEST(StationaryMatches, ATurntablesBackgroundIsRemoved) {
  auto matches = AllMatches(4);
  const sfm::StationaryShare share = sfm::RemoveStationaryMatches(Turntable(4, 20), &matches);
  EXPECT_EQ(share.pairs, 6);
  EXPECT_EQ(share.split_pairs, 6);
  EXPECT_EQ(share.removed, 6u * 40);
  for (const sfm::PairMatches& pair : matches) {
    ASSERT_EQ(pair.matches.size(), 40u);
    EXPECT_EQ(pair.matches.back(), (Match{39, 39}));
  }
}

TEST(StationaryMatches, ABackgroundFillsThePictureAWatermarkOnlyACorner) {
  for (const bool fills : {true, false}) {
    auto matches = AllMatches(7);
    std::vector<sfm::Features> features = Turntable(7, 20);
    for (sfm::Features& picture : features) {
      for (std::size_t k = 40; k < 80; ++k) {
        const auto column = static_cast<float>(k % 8), row = static_cast<float>((k - 40) / 8);
        const float spacing = fills ? 75 : 10;
        picture.keypoints[k].x = 600 - spacing * column;
        picture.keypoints[k].y = 600 - spacing * row;
      }
    }
    const sfm::StationaryShare share = sfm::RemoveStationaryMatches(features, &matches);
    EXPECT_EQ(share.removed, 21u * 40);
    EXPECT_EQ(share.share, 0.5);
    EXPECT_EQ(share.IsBackground(), fills) << share.covered;
  }
  auto matches = AllMatches(4);
  EXPECT_FALSE(sfm::RemoveStationaryMatches(Turntable(4, 2), &matches).IsBackground());
}

TEST(StationaryMatches, ChanceAmongManyThatMoveIsNoBackground) {
  // The watermark above, and in half of the cells a few that stand still beside six times as many that move.
  auto matches = AllMatches(7);
  std::vector<sfm::Features> features = Turntable(7, 20);
  const auto add = [&](float x, float y, float step) {
    for (int i = 0; i < 7; ++i) {
      features[static_cast<std::size_t>(i)].keypoints.push_back(
          {.x = x + step * static_cast<float>(i), .y = y});
    }
    const int k = static_cast<int>(features[0].keypoints.size()) - 1;
    for (sfm::PairMatches& pair : matches) pair.matches.push_back({k, k});
  };
  for (std::size_t k = 0; k < 32; ++k) {
    const float x = 45 + 75 * static_cast<float>(k % 8), y = 45 + 75 * static_cast<float>(k / 8);
    add(x, y, 0);
    for (int moving = 0; moving < 6; ++moving) add(x, y, 5);
  }
  for (sfm::Features& picture : features) {
    for (std::size_t k = 40; k < 80; ++k) {
      picture.keypoints[k].x = 600 - 2 * static_cast<float>(k % 8);
      picture.keypoints[k].y = 600 - 2 * static_cast<float>(k / 8);
    }
  }
  const sfm::StationaryShare share = sfm::RemoveStationaryMatches(features, &matches);
  EXPECT_GT(share.removed, 21u * 40);
  EXPECT_FALSE(share.IsBackground()) << share.covered;
}

TEST(StationaryMatches, ASlowCameraKeepsAllMatches) {
  auto matches = AllMatches(3);
  EXPECT_EQ(sfm::RemoveStationaryMatches(Turntable(3, 2), &matches).removed, 0u);  // 2 and 4 px
  EXPECT_EQ(matches[0].matches.size(), 80u);
}

TEST(StationaryMatches, FewSplitPairsAreChance) {
  // In all pictures but the last ones the other half moves as well: 1, 6 or 10 of 15 pairs are split.
  for (const auto& [last, split] : {std::pair{2, 1}, {4, 6}, {5, 10}}) {
    auto matches = AllMatches(6);
    std::vector<sfm::Features> features = Turntable(6, 20);
    for (int i = 0; i < 6; ++i) {
      for (std::size_t k = 40; k < 80; ++k) {
        features[static_cast<std::size_t>(i)].keypoints[k].x +=
            static_cast<float>(20 * std::min(i, 6 - last));
      }
    }
    const sfm::StationaryShare share = sfm::RemoveStationaryMatches(features, &matches);
    EXPECT_EQ(share.split_pairs, split);
    EXPECT_EQ(share.removed, static_cast<std::size_t>(split < 8 ? 0 : 40 * split));
  }
}

// How many matches are removed from one pair in which so many move by 12, by 8 and by 4 px, downwards. The
// second picture lists its keypoints from the last one on.
std::size_t Removed(int moving, int between, int still) {
  const int n = moving + between + still;
  std::vector<sfm::Features> features(2);
  std::vector<sfm::PairMatches> matches = {{.a = 0, .b = 1}};
  features[1].keypoints.resize(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) {
    const float x = static_cast<float>(20 * k), step = k < moving ? 12 : k < moving + between ? 8 : 4;
    features[0].keypoints.push_back({.x = x, .y = 5});
    features[1].keypoints[static_cast<std::size_t>((k + 1) % n)] = {.x = x, .y = 5 + step};
    matches[0].matches.push_back({k, (k + 1) % n});
  }
  const std::size_t removed = sfm::RemoveStationaryMatches(features, &matches).removed;
  EXPECT_EQ(matches[0].matches.size(), static_cast<std::size_t>(n) - removed);
  return removed;
}

TEST(StationaryMatches, APairIsSplitWhenEnoughMoveAndEnoughStandStill) {
  EXPECT_EQ(Removed(15, 30, 15), 15u);  // what is neither stays
  EXPECT_EQ(Removed(14, 30, 15), 0u);   // a camera that hardly moves
  EXPECT_EQ(Removed(15, 0, 14), 0u);
  EXPECT_EQ(Removed(60, 0, 15), 15u);  // a fifth
  EXPECT_EQ(Removed(61, 0, 15), 0u);
}

}  // namespace
