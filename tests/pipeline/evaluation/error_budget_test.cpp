// Where held-out error lies: known mistakes are found, and lead to the advice that mends them.
#include "pipeline/evaluation/error_budget.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "nerf/sampling/pose_motion.h"
#include "pipeline/evaluation/evaluation.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::StartsWith;

// Eight cameras around the chequered sphere, whose pictures are there.
class ErrorBudgetTest : public testing::Test {
 protected:
  ErrorBudgetTest() {
    for (const io::Frame& frame : scene_.frames) {
      io::WriteImage(
          frame.image_path,
          pipeline::QuantizeView(tests::SphereField().Render(scene_.cameras[0], frame.world_from_cam, {})));
    }
  }

  pipeline::Scores Measure(const io::Scene& train, const io::Scene& test, float shade = 0) {
    const tests::SphereField field(shade);
    pipeline::RenderViews(field, test, dir_ / "scored", 1);
    pipeline::Scores scores = pipeline::ScoreViews(test, dir_ / "scored", {});
    pipeline::MeasureErrors(field, train, test, 2, &scores);
    return scores;
  }

  const TempDir dir_;
  const io::Scene scene_ =
      tests::RingScene(8, 240, 180, [&](int i) { return dir_ / (std::to_string(i) + ".png"); });
};

TEST_F(ErrorBudgetTest, AWrongPoseIsFound) {
  io::Scene test = scene_;
  test.frames.resize(1);
  nerf::Vector6d motion;
  motion << 0.02, -0.03, 0.05, 0.005, -0.004, 0.01;
  test.frames[0].world_from_cam = nerf::MovedPose(scene_.frames[0].world_from_cam, motion);
  const pipeline::Scores scores = Measure(scene_, test);
  ASSERT_TRUE(scores.budget);
  EXPECT_GT(scores.budget->fitted_psnr_db, scores.psnr_db + 5);
  EXPECT_GT(scores.budget->moved_px, 1);
  EXPECT_NEAR(scores.budget->sharpness, 1, 0.05);
  EXPECT_GT(scores.budget->worst_error, 0.5);  // what is left are edges
  EXPECT_THAT(pipeline::Advice(scores), ElementsAre(StartsWith("Poses: ")));
}

// The field is brighter by a known shade: all of the error, spread evenly.
TEST_F(ErrorBudgetTest, AnEvenErrorLiesNowhereInParticular) {
  const pipeline::Scores scores = Measure(scene_, scene_, 10.f / 255);
  ASSERT_EQ(scores.views.size(), 8u);
  EXPECT_NEAR(scores.budget->worst_error, 0.05, 0.01);
  EXPECT_NEAR(scores.budget->unseen_error, scores.budget->unseen_pixels, 0.01);
  EXPECT_NEAR(scores.budget->fitted_psnr_db, scores.psnr_db, 0.1);
  EXPECT_GT(scores.budget->fitted_aligned_psnr_db, scores.psnr_db + 3);
  for (const pipeline::ViewScore& view : scores.views) {
    EXPECT_EQ(view.budget->psnr_db, view.psnr_db);
    EXPECT_GE(view.budget->fitted_psnr_db, view.psnr_db);
  }
}

// One training view cannot be three.
TEST_F(ErrorBudgetTest, WhatFewViewsSawIsCounted) {
  io::Scene one = scene_;
  one.frames.resize(1);
  EXPECT_EQ(Measure(one, one, 0.05f).budget->unseen_pixels, 1);
  EXPECT_LT(Measure(scene_, one, 0.05f).budget->unseen_pixels, 0.7);
}

TEST_F(ErrorBudgetTest, OfManyViewsSomeAreLookedAt) {
  io::Scene many = tests::RingScene(50, 240, 180, [&](int i) { return dir_ / (std::to_string(i) + ".png"); });
  for (const io::Frame& frame : many.frames)
    io::WriteImage(frame.image_path, io::ReadImage(scene_.frames[0].image_path));
  const pipeline::Scores scores = Measure(scene_, many);
  std::size_t n = 0;
  double psnr_db = 0;
  for (const pipeline::ViewScore& view : scores.views) {
    if (!view.budget) continue;
    ++n;
    psnr_db += view.psnr_db;
  }
  EXPECT_EQ(n, pipeline::kBudgetViews);
  EXPECT_TRUE(scores.views[25].budget);
  EXPECT_NEAR(scores.budget->psnr_db, psnr_db / static_cast<double>(n), 1e-9);
}

pipeline::Scores Perfect() {
  pipeline::Scores scores;
  scores.psnr_db = 30;
  scores.training_psnr_db = 30.5;
  scores.budget = {.psnr_db = 30, .fitted_psnr_db = 30.1, .fitted_aligned_psnr_db = 30.2, .sharpness = 0.9};
  return scores;
}

TEST(Advice, NamesWhatGainsMostFirst) {
  EXPECT_THAT(pipeline::Advice(Perfect()), IsEmpty());
  EXPECT_THAT(pipeline::Advice(pipeline::Scores()), IsEmpty());

  pipeline::Scores scores = Perfect();
  scores.budget->fitted_psnr_db = 30.7, scores.budget->fitted_aligned_psnr_db = 31.9;
  EXPECT_THAT(pipeline::Advice(scores), ElementsAre(StartsWith("Colours: "), StartsWith("Poses: ")));

  scores = Perfect();
  scores.budget->unseen_pixels = 0.05, scores.budget->unseen_error = 0.4;
  for (const double share : {0.1, 0.9, 0.3, 0.5})
    scores.views.push_back({.name = std::to_string(share), .budget = {{.unseen_error = share}}});
  EXPECT_THAT(pipeline::Advice(scores),
              ElementsAre(testing::AllOf(StartsWith("Views: 40 %"),
                                         testing::HasSubstr("0.900000, 0.500000, 0.300000 show"))));

  scores = Perfect();
  scores.budget->sharpness = 0.6;
  EXPECT_THAT(pipeline::Advice(scores), ElementsAre(StartsWith("Time: ")));
  scores.training_psnr_db = 33;  // the field has the detail, where it was trained
  EXPECT_THAT(pipeline::Advice(scores), ElementsAre(StartsWith("Pictures: ")));
}

}  // namespace
