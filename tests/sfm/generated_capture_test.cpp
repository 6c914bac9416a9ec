// Captures of numbers instead of pictures, reconstructed from their matches on.
#include <algorithm>
#include <cmath>
#include <map>

#include "sfm/colmap/colmap_database.h"
#include "sfm/reconstruction.h"
#include "sfm/synthetic/synthetic_capture.h"
#include "tests/support/files/small_capture.h"
#include "tests/support/programs/require_program.h"

namespace {

namespace fs = std::filesystem;

class GeneratedCapture : public SmallCapture {
 protected:
  sfm::Reconstruction Run(const sfm::CaptureOptions& options,
                          const sfm::ReconstructionOptions& how = {.threads = 2}) {
    return Run(sfm::MakeSyntheticCapture(options), how);
  }
  sfm::Reconstruction Run(const sfm::SyntheticCapture& capture,
                          const sfm::ReconstructionOptions& how = {.threads = 2}) {
    pictures_ = capture.pictures;
    return sfm::ReconstructMatches(
        pictures_, capture.features, capture.matches, folder_ / "work", how, [this](const std::string& line) {
          decisions_.push_back(line);
        });
  }
};

// A ring that lacks 4 of 20 pictures after n_near, so that its order leaps over 90 degrees. What lies beyond
// shares few points with the rest: so few that it could as well be another place like this one.
sfm::SyntheticCapture LeapingRing(std::size_t n_shared, int n_near) {
  sfm::SyntheticCapture capture = sfm::MakeSyntheticCapture({.pictures = 20, .points = 600});
  // The first keypoints of a picture are the points that it sees.
  std::map<std::pair<int, int>, std::size_t> point_of;  // by picture and keypoint
  std::vector<int> n_keypoints(20, 0);
  for (std::size_t p = 0; p < capture.truth.points.size(); ++p) {
    for (const int picture : capture.truth.points[p].frame_indices)
      point_of[{picture, n_keypoints[static_cast<std::size_t>(picture)]++}] = p;
  }
  const auto is_gone = [&](int picture) { return picture >= n_near && picture < n_near + 4; };
  std::erase_if(capture.matches, [&](const auto& pair) { return is_gone(pair.a) || is_gone(pair.b); });
  for (sfm::PairMatches& pair : capture.matches) {
    if (pair.a < n_near && pair.b >= n_near) {
      std::erase_if(pair.matches, [&](const std::array<int, 2>& match) {
        return point_of.at({pair.a, match[0]}) >= n_shared;
      });
    }
    for (int* picture : {&pair.a, &pair.b}) *picture -= *picture >= n_near ? 4 : 0;
  }
  capture.pictures.erase(capture.pictures.begin() + n_near, capture.pictures.begin() + n_near + 4);
  capture.features.erase(capture.features.begin() + n_near, capture.features.begin() + n_near + 4);
  return capture;
}

TEST_F(GeneratedCapture, WhatLiesBeyondALeapOfTheWalkIsTakenOut) {
  REQUIRE_PROGRAM("colmap");
  for (const bool is_held : {false, true}) {
    const sfm::Reconstruction result = Run(LeapingRing(is_held ? 200 : 45, 12));
    EXPECT_EQ(result.model.scene.frames.size(), is_held ? 16u : 12u);
    EXPECT_EQ(Decided("4 pictures taken out"), is_held ? 0 : 1);
    decisions_.clear();
    fs::remove_all(folder_ / "work");
  }
}

TEST_F(GeneratedCapture, WhatALeapLeavesMustBeMoreThanAFragment) {
  REQUIRE_PROGRAM("colmap");
  const sfm::Refusal refusal = RefusalOf([&] { Run(LeapingRing(45, 9)); });
  EXPECT_EQ(Decided("7 pictures taken out"), 1);
  EXPECT_NE(refusal.figures.find("only 9 fit together"), std::string::npos) << refusal.figures;
}

// A fifth of the usual number of points is enough for a picture while they fit as well as elsewhere.
TEST_F(GeneratedCapture, FewPointsThatFitBadlyHoldNoPicture) {
  REQUIRE_PROGRAM("colmap");
  constexpr std::size_t kPicture = 5;
  constexpr int kPoints = 30;
  for (const bool fits : {true, false}) {
    sfm::SyntheticCapture capture =
        sfm::MakeSyntheticCapture({.pictures = 12, .points = 300, .noise_px = 0.3});
    for (sfm::PairMatches& pair : capture.matches) {
      const std::size_t side = pair.b == kPicture ? 1 : 0;
      if (pair.a != kPicture && pair.b != kPicture) continue;
      std::erase_if(pair.matches, [&](const auto& match) { return match[side] >= kPoints; });
    }
    std::vector<sfm::Keypoint>& keypoints = capture.features[kPicture].keypoints;
    for (std::size_t i = 0; !fits && i < keypoints.size(); ++i) {
      keypoints[i].x += static_cast<float>(2 * std::sin(1.7 * static_cast<double>(i)));
      keypoints[i].y += static_cast<float>(2 * std::cos(2.3 * static_cast<double>(i)));
    }
    const sfm::Reconstruction result = Run(capture);
    EXPECT_EQ(result.model.scene.frames.size(), fits ? 12u : 11u);
    ASSERT_EQ(result.unregistered.size(), fits ? 0u : 1u);
    if (fits) continue;
    EXPECT_EQ(result.unregistered[0].name, pictures_[kPicture].name);
    EXPECT_NE(result.unregistered[0].refusal.figures.find("reflections"), std::string::npos)
        << result.unregistered[0].refusal.figures;
    fs::remove_all(folder_ / "work");
  }
}

// Parallel cameras on a line do not tell the focal length; an overlay stands still in all pictures.
TEST_F(GeneratedCapture, OverlaysAreRemovedAndKnownFocalLengthsKept) {
  REQUIRE_PROGRAM("colmap");
  const sfm::Reconstruction result = Run({.trajectory = sfm::Trajectory::kLine,
                                          .pictures = 8,
                                          .points = 150,
                                          .baseline = 0.15,
                                          .noise_px = 0.5,
                                          .outliers = sfm::Outliers::kStaticOverlay,
                                          .outlier_share = 0.4});
  EXPECT_EQ(result.model.scene.frames.size(), 8u);
  EXPECT_EQ(Decided("matches that stand still in the picture"), 1);
  EXPECT_EQ(Decided("background stands still while the subject turns"), 1);
  EXPECT_EQ(Decided("the background contradicts them"), 1);
  EXPECT_TRUE(result.turntable);
  EXPECT_NEAR(result.stationary_share, 0.4, 0.05);
  EXPECT_EQ(Decided("held at 1280 px (known)"), 1);
  EXPECT_EQ(Decided("a focal length per picture"), 0) << "one picture tells it even less";
}

TEST_F(GeneratedCapture, WhereSidesLookAlikeOnlyFollowingPicturesAreTrusted) {
  REQUIRE_PROGRAM("colmap");
  const sfm::CaptureOptions box{
      .structure = sfm::Structure::kIdenticalSides, .pictures = 16, .points = 400, .noise_px = 0.5};
  EXPECT_EQ(RefusalOf([&] { Run(box); }).cause, sfm::RefusalCause::kContradictedPoses);
  EXPECT_EQ(Decided("trying again with following pictures only"), 1);
  std::map<std::string, int> position;
  for (const sfm::Picture& picture : pictures_) position.emplace(picture.name, position.size());
  const auto pairs = sfm::ReadVerifiedPairs(folder_ / "work" / "attempt2" / "database.db");
  EXPECT_GT(pairs.size(), 15u);
  for (const sfm::VerifiedPair& pair : pairs) {
    EXPECT_LE(std::abs(position[pair.name_a] - position[pair.name_b]), 3);
  }
}

}  // namespace
