// Training to a target quality: budgets of the attempts, and when they end.
#include "nerf/training/target_training.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"

namespace nerf {
namespace {

TEST(NextBudget, FollowsTheSlopeOverTheLogarithmOfTime) {
  // 2.7 dB per factor 3 until two attempts say otherwise; 15 % on top.
  EXPECT_NEAR(NextBudget({{5, 26}}, 28.7), 5 * 3 * 1.15, 1e-9);
  EXPECT_NEAR(NextBudget({{5, 26}, {15, 27.5}}, 29), 15 * 3 * 1.15, 1e-9);
  EXPECT_NEAR(NextBudget({{5, 26}}, 26.01), 5 * 1.5, 1e-9) << "least growth";
  EXPECT_NEAR(NextBudget({{5, 26}}, 60), 5 * 8, 1e-9) << "most growth";
  EXPECT_NEAR(NextBudget({{5, 26}, {15, 25.9}}, 27), 15 * 8, 1e-9) << "no gain is taken for noise";
}

class TargetTraining : public testing::Test {
 protected:
  TargetTraining()
      : scene_(tests::BallScene(dir_ / "train", 8, 0, {.size = 32})),
        heldout_(tests::BallScene(dir_ / "heldout", 2, 1, {.size = 32})) {}

  TrainReport Run(double target_psnr, double ceiling_s) {
    TrainOptions options;
    options.time_s = ceiling_s;
    options.target_psnr = target_psnr;
    options.samples_per_step = 1024;
    std::filesystem::create_directories(dir_ / "out");
    return TrainToTarget(scene_, heldout_, options, dir_ / "out");
  }

  TempDir dir_;
  io::Scene scene_, heldout_;
};

TEST_F(TargetTraining, EndsAsSoonAsTheTargetIsReached) {
  const TrainReport report = Run(12, 60);
  EXPECT_GE(report.heldout_psnr, 12);
  EXPECT_EQ(report.budget_s, 5);
  EXPECT_LT(report.train_s, 5);
  EXPECT_NE(report.events.back().find("reached"), std::string::npos) << report.events.back();
}

TEST_F(TargetTraining, GivesUpAfterAnAttemptOfTheCeiling) {
  const TrainReport report = Run(90, 0.5);
  EXPECT_LT(report.heldout_psnr, 90);
  EXPECT_EQ(report.budget_s, 0.5);
  EXPECT_TRUE(std::filesystem::exists(dir_ / "out/checkpoint.bin"));
  // A finished run that is resumed knows its budget and stays as it is.
  const TrainReport again = Run(90, 0.5);
  EXPECT_EQ(again.steps, report.steps);
}

TEST_F(TargetTraining, NeedsHeldoutViews) {
  heldout_ = {};
  EXPECT_THROW(Run(12, 1), io::Error);
}

}  // namespace
}  // namespace nerf
