// Gaps of a walk: what is matched around them, and that two parts become one in the right place or stay two.
#include "sfm/gaps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "sfm/adjust_joined.h"
#include "sfm/mapping/bridging.h"
#include "sfm/scene/pose_error.h"
#include "sfm/synthetic/synthetic_capture.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/programs/require_program.h"

namespace {

// COLMAP drops models of fewer than 10 pictures. kBehind: the first picture behind the gap.
constexpr int kPictures = 22, kBehind = 12;
constexpr int kMatched = 4;  // pictures at most so far apart

bool IsAcross(const sfm::PairMatches& pair) { return pair.a < kBehind && pair.b >= kBehind; }

// A ring of which pictures before and behind a gap were never matched with each other.
struct Walk {
  Walk() {
    capture = sfm::MakeSyntheticCapture({.pictures = kPictures, .points = 150, .noise_px = 0.3, .seed = 4});
    views = std::make_shared<sfm::CapturedViews>(sfm::CapturedViews{
        sfm::Names(capture.pictures), sfm::CameraGroups(capture.pictures), capture.features});
    for (const sfm::PairMatches& pair : capture.matches) {
      if (!IsAcross(pair) && pair.b - pair.a <= kMatched) first.push_back(pair);
    }
  }

  sfm::MappingAttempt Map(const std::filesystem::path& folder) const {
    return sfm::Attempt(capture.pictures, views, first, "", folder, {.threads = 2});
  }

  // What matching the pictures around the gap again gives: `most` matches of a pair across, evenly chosen.
  std::vector<sfm::PairMatches> Following(const sfm::MappingAttempt& before, std::size_t most) const {
    const sfm::ImagePairs pairs = sfm::FollowingPairs(sfm::AroundGaps(before));
    std::vector<sfm::PairMatches> following;
    for (sfm::PairMatches pair : capture.matches) {
      if (pairs.count({pair.a, pair.b}) == 0) continue;
      if (IsAcross(pair) && pair.matches.size() > most) {
        for (std::size_t i = 0; i < most; ++i) pair.matches[i] = pair.matches[i * pair.matches.size() / most];
        pair.matches.resize(most);
      }
      following.push_back(pair);
    }
    return following;
  }

  sfm::MappingAttempt Bridge(const sfm::MappingAttempt& before,
                             const std::vector<sfm::PairMatches>& matches,
                             const std::filesystem::path& folder) const {
    return sfm::Bridge(before,
                       capture.pictures,
                       views,
                       matches,
                       "",
                       folder,
                       {.adjust_joined = sfm::AdjustBridged, .threads = 2});
  }

  sfm::SyntheticCapture capture;
  std::shared_ptr<sfm::CapturedViews> views;
  std::vector<sfm::PairMatches> first;
};

TEST(Gaps, FollowingPicturesJoinWhatHangsOnThemAlone) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  const Walk walk;
  const sfm::MappingAttempt before = walk.Map(dir / "before");
  ASSERT_EQ(before.Registered(), kBehind);
  ASSERT_EQ(before.models.size(), 2u);
  const sfm::MappingAttempt after = walk.Bridge(before, walk.Following(before, 30), dir / "after");
  ASSERT_EQ(after.Registered(), kPictures);
  EXPECT_EQ(after.n_joined, 1u);
  const sfm::PoseError error = sfm::ComparePoses(after.models.front().scene, walk.capture.truth);
  EXPECT_LT(error.rotation_max_deg, 0.5);
  EXPECT_LT(error.centre_rmse, 0.02);
}

// Two places that look alike: the pictures that follow each other show nothing in common, others seem to.
TEST(Gaps, PlacesThatOnlyLookAlikeAreNotJoined) {
  REQUIRE_PROGRAM("colmap");
  const TempDir dir;
  Walk walk;
  for (const sfm::PairMatches& pair : walk.capture.matches) {
    if (pair.a != 2 || pair.b != 16) continue;
    walk.first.push_back(pair);
    walk.first.back().matches.resize(25);
  }
  const sfm::MappingAttempt before = walk.Map(dir / "before");
  ASSERT_EQ(before.Registered(), kBehind);
  std::vector<sfm::PairMatches> following = walk.Following(before, 30);
  std::erase_if(following, IsAcross);
  const sfm::MappingAttempt after = walk.Bridge(before, following, dir / "after");
  EXPECT_EQ(after.Registered(), kBehind);
  EXPECT_EQ(after.n_joined, 0u);
  EXPECT_EQ(after.evidence.pairs.size(), before.evidence.pairs.size())
      << "pairs that were not used stay known";
}

// Two near pictures and two far ones: points of each pair, and `across` points that one of each sees.
io::Scene TwoSides(int across, int of_each_far) {
  io::Scene scene;
  for (const char* name : {"n1", "n2", "f1", "f2"}) scene.frames.push_back({name, 0, {}, {}});
  const auto add = [&](int n, std::vector<int> frames) {
    for (int i = 0; i < n; ++i) scene.points.push_back({.frame_indices = frames});
  };
  add(100, {0, 1}), add(across, {1, 2}), add(of_each_far, {2, 3});
  return scene;
}

TEST(Gaps, SidesAreHeldTogetherByPointsOfBothAndOfEachPicture) {
  const std::set<std::string> near = {"n1", "n2"};
  EXPECT_TRUE(sfm::IsHeldTogether(TwoSides(15, 15), near));
  EXPECT_FALSE(sfm::IsHeldTogether(TwoSides(14, 40), near));
  EXPECT_FALSE(sfm::IsHeldTogether(TwoSides(40, 14), near));               // f2 sees 14
  EXPECT_TRUE(sfm::IsHeldTogether(TwoSides(15, 15), {"n1", "n2", "f2"}));  // f1 alone is behind, and sees 30
}

TEST(Gaps, LieAroundPicturesThatTheModelLacks) {
  sfm::MappingAttempt attempt;
  auto views = std::make_shared<sfm::CapturedViews>();
  for (int i = 0; i < 12; ++i) views->names.push_back("p" + std::to_string(10 + i));
  attempt.views = views;
  const auto around = [&](int first, int end) {
    attempt.models.assign(1, {});
    for (int i = 0; i < 12; ++i) {
      if (i >= first && i < end) continue;
      attempt.models[0].scene.frames.push_back({views->names[static_cast<std::size_t>(i)]});
    }
    return sfm::AroundGaps(attempt);
  };
  EXPECT_EQ(around(4, 7), (std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(around(4, 6), std::vector<int>{}) << "two strays";
  EXPECT_EQ(around(9, 12), (std::vector<int>{6, 7, 8, 9, 10, 11}));
  EXPECT_EQ(around(0, 0), std::vector<int>{}) << "nothing is missing";
  EXPECT_EQ(around(0, 12), std::vector<int>{}) << "nothing to go on from";
  EXPECT_EQ(sfm::FollowingPairs({2, 4, 5, 9}), (sfm::ImagePairs{{2, 4}, {2, 5}, {4, 5}}));
}

TEST(Gaps, AddedFeaturesLieBehindThoseThatWereThere) {
  std::vector<sfm::Features> features(2), added(2);
  features[0] = {{{.x = 1}, {.x = 2}}, std::vector<std::uint8_t>(2 * sfm::kDescriptorBytes, 7)};
  added[0] = {{{.x = 3}}, std::vector<std::uint8_t>(sfm::kDescriptorBytes, 8)};
  added[1] = {{{.x = 4}, {.x = 5}}, std::vector<std::uint8_t>(2 * sfm::kDescriptorBytes, 9)};
  std::vector<sfm::PairMatches> matches = {{0, 1, {{1, 0}}}};
  sfm::AddFeatures(added, {{0, 1, {{0, 1}}}}, &features, &matches);
  ASSERT_EQ(features[0].keypoints.size(), 3u);
  EXPECT_EQ(features[0].keypoints[2].x, 3);
  EXPECT_EQ(features[0].descriptors[2 * sfm::kDescriptorBytes], 8);
  EXPECT_EQ(features[1].keypoints.size(), 2u);
  EXPECT_EQ(matches[0].matches, (std::vector<std::array<int, 2>>{{1, 0}, {2, 1}}));
}

TEST(Gaps, TheHingeIsAsUncertainAsThePicturesBehindIt) {
  io::ColmapModel model;
  sfm::BundleUncertainty uncertainty;
  for (const auto& [name, deg] : {std::pair{"a", 0.1}, {"b", 3.0}, {"c", 2.0}, {"d", 9.0}}) {
    model.scene.frames.push_back({name});
    uncertainty.poses.push_back({.rotation_deg = deg});
  }
  EXPECT_EQ(sfm::MedianRotationDeg(model, uncertainty, {"b", "c", "d", "not in the model"}), 3);
  EXPECT_TRUE(std::isinf(sfm::MedianRotationDeg(model, uncertainty, {})));
}

}  // namespace
