// A turn and a flat surface are told apart, whatever is known of the focal length.
#include "sfm/mapping/flat_pairs.h"

#include <gtest/gtest.h>

#include "sfm/mapping/mapping_attempt.h"
#include "sfm/synthetic/synthetic_capture.h"

namespace {

using sfm::PairGeometry;

// All pairs, as if COLMAP had found a homography in each; the share of them that is called a rotation.
double RotationShareOf(const sfm::CaptureOptions& options) {
  const sfm::SyntheticCapture capture = sfm::MakeSyntheticCapture(options);
  const sfm::CapturedViews views{
      sfm::Names(capture.pictures), sfm::CameraGroups(capture.pictures), capture.features};
  std::vector<sfm::VerifiedPair> pairs;
  for (const sfm::PairMatches& pair : capture.matches) {
    if (pair.matches.size() < 30) continue;
    pairs.push_back({views.names[static_cast<std::size_t>(pair.a)],
                     views.names[static_cast<std::size_t>(pair.b)],
                     static_cast<int>(pair.matches.size()),
                     PairGeometry::kHomography,
                     pair.matches});
  }
  sfm::DistinguishFlatPairs(views, &pairs);
  int rotations = 0;
  for (const sfm::VerifiedPair& pair : pairs) {
    EXPECT_NE(pair.geometry, PairGeometry::kHomography);
    EXPECT_NE(pair.geometry, PairGeometry::kGeneral);
    rotations += pair.geometry == PairGeometry::kRotation;
  }
  EXPECT_GT(pairs.size(), 5u);
  return static_cast<double>(rotations) / static_cast<double>(pairs.size());
}

sfm::CaptureOptions Turn(double focal_guess) {
  return {.trajectory = sfm::Trajectory::kRotationOnly, .focal_guess = focal_guess, .noise_px = 0.5};
}

sfm::CaptureOptions Survey(double relief, double focal_guess) {
  return {.trajectory = sfm::Trajectory::kNadirGrid,
          .structure = sfm::Structure::kField,
          .relief = relief,
          .pictures = 9,
          .points = 1500,
          .baseline = 0.2,
          .focal_guess = focal_guess,
          .noise_px = 0.5};
}

TEST(FlatPairs, ATurnIsARotationWhateverIsKnownOfTheFocalLength) {
  for (const double focal_guess : {1.0, 0.85, 1.2, 0.0}) EXPECT_EQ(RotationShareOf(Turn(focal_guess)), 1);
  // 22 mm (35 mm equivalent) and 83 mm, both unknown.
  for (const double focal_px : {630, 2300}) {
    sfm::CaptureOptions options = Turn(0);
    options.cameras[0].fl_x = options.cameras[0].fl_y = focal_px;
    EXPECT_EQ(RotationShareOf(options), 1) << focal_px;
  }
}

TEST(FlatPairs, DistortionDoesNotMakeABaseline) {
  sfm::CaptureOptions options = Turn(1);
  options.cameras[0].k1 = -0.05;
  EXPECT_GT(RotationShareOf(options), 0.95);
}

TEST(FlatPairs, AFlatGroundSeenFromAboveIsNoRotation) {
  for (const double relief : {0.0, 0.01}) {
    EXPECT_LT(RotationShareOf(Survey(relief, 1)), 0.1) << relief;
    // Pairs that share a small corner only may be either; they do not decide.
    for (const double focal_guess : {0.85, 1.2, 0.0})
      EXPECT_LT(RotationShareOf(Survey(relief, focal_guess)), 0.5) << relief << " " << focal_guess;
  }
}

TEST(FlatPairs, StepsTooSmallToMeasureAreRotations) {
  sfm::CaptureOptions options = Survey(0, 1);
  options.baseline = 0.0005;
  EXPECT_EQ(RotationShareOf(options), 1);
}

TEST(FlatPairs, OtherPairsAreLeftAlone) {
  const sfm::CapturedViews views{{"a", "b"}, {{{"a", "b"}, 100, 100, 120}}, std::vector<sfm::Features>(2)};
  std::vector<sfm::VerifiedPair> pairs = {{"a", "b", 50, PairGeometry::kGeneral},
                                          {"a", "b", 50, PairGeometry::kHomography}};
  sfm::DistinguishFlatPairs(views, &pairs);
  EXPECT_EQ(pairs[0].geometry, PairGeometry::kGeneral);
  EXPECT_EQ(pairs[1].geometry, PairGeometry::kHomography) << "no matches to decide by";
}

}  // namespace
