// When held-out views count as reconstructed.
#include "pipeline/evaluation/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {

using pipeline::Judge;
using pipeline::Outcome;

pipeline::Scores ScoresOf(const std::vector<double>& psnr, double training_db, double plain_db) {
  pipeline::Scores scores;
  for (std::size_t i = 0; i < psnr.size(); ++i)
    scores.views.push_back({.name = std::to_string(i) + ".png", .psnr_db = psnr[i]});
  scores.training_psnr_db = training_db;
  scores.plain_psnr_db = plain_db;
  return scores;
}

TEST(Verdict, FollowsTheGapBetweenTrainingAndHeldOutViews) {
  EXPECT_EQ(Judge(ScoresOf({27, 28, 29}, 30.5, 12)).outcome, Outcome::kReconstructed);
  EXPECT_EQ(Judge(ScoresOf({27, 28, 29}, 30.5, 12)).text, "");
  EXPECT_EQ(Judge(ScoresOf({27, 28, 29}, 31.5, 12)).outcome, Outcome::kDoubtful);
  EXPECT_EQ(Judge(ScoresOf({13, 14, 15}, 36, 9)).outcome, Outcome::kFailed);
  EXPECT_THAT(Judge(ScoresOf({13, 14, 15}, 36, 9)).text, testing::HasSubstr("memorised (36.0 dB)"));
}

// Pictures that are mostly dark are fitted very closely; what the others show decides.
TEST(Verdict, ViewsThatShowNineTenthsAreNoFailure) {
  EXPECT_EQ(Judge(ScoresOf({26, 27, 28}, 35, 16)).outcome, Outcome::kDoubtful);
  EXPECT_THAT(Judge(ScoresOf({26, 27, 28}, 35, 16)).text, testing::HasSubstr("fitted (35.0 dB)"));
  EXPECT_EQ(Judge(ScoresOf({26, 27, 28}, 35, 18)).outcome, Outcome::kFailed);
}

TEST(Verdict, SharperTrainingPicturesOfARightSceneAreNoDoubt) {
  pipeline::Scores scores = ScoresOf({32, 33, 34}, 36.6, 13);
  scores.hidden_points = 0.04;
  EXPECT_EQ(Judge(scores).outcome, Outcome::kReconstructed);
  EXPECT_EQ(Judge(scores).text, "");
  scores.hidden_points = 0.31;
  EXPECT_EQ(Judge(scores).outcome, Outcome::kDoubtful);
  scores.hidden_points.reset();
  EXPECT_EQ(Judge(scores).outcome, Outcome::kDoubtful);
  scores.hidden_points = 0.04, scores.training_psnr_db = 39.5;
  EXPECT_EQ(Judge(scores).outcome, Outcome::kDoubtful);
}

// Few pictures leave gaps between them; surfaces in their right places are no memory of pictures.
TEST(Verdict, SurfacesInTheirPlacesAreNoFailure) {
  pipeline::Scores scores = ScoresOf({20, 22, 24}, 34, 15);
  scores.hidden_points = 0.11;
  EXPECT_EQ(Judge(scores).outcome, Outcome::kDoubtful);
  scores.hidden_points = 0.31;
  EXPECT_EQ(Judge(scores).outcome, Outcome::kFailed);
  scores = ScoresOf({14, 14, 15}, 15, 12);  // hardly better than one colour
  scores.hidden_points = 0;
  EXPECT_EQ(Judge(scores).outcome, Outcome::kFailed);
}

TEST(Verdict, PicturesOfOneColourAreNoReconstruction) {
  EXPECT_EQ(Judge(ScoresOf({14, 14, 15}, 15, 12)).outcome, Outcome::kFailed);
  EXPECT_THAT(Judge(ScoresOf({14, 14, 15}, 15, 12)).text, testing::HasSubstr("one colour (12.0 dB)"));
}

TEST(Verdict, OneBadViewIsNamedAndDecidesNothing) {
  const pipeline::Verdict verdict = Judge(ScoresOf({27, 15, 28, 29, 12}, 29, 9));
  EXPECT_EQ(verdict.outcome, Outcome::kReconstructed);
  EXPECT_EQ(verdict.strays, (std::vector<std::string>{"4.png", "1.png"}));
}

TEST(Verdict, ScoresOfOlderRunsAreNotCondemned) {
  pipeline::Scores scores = ScoresOf({13, 14}, 0, 0);
  scores.training_psnr_db.reset();
  scores.plain_psnr_db.reset();
  EXPECT_EQ(Judge(scores).outcome, Outcome::kReconstructed);
  EXPECT_EQ(Judge({}).outcome, Outcome::kReconstructed);
}

}  // namespace
