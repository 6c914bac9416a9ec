// curve.csv: points that are written come back, also behind those of an interrupted run.
#include "nerf/training/training_curve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/files/temp_dir.h"

namespace {

TEST(TrainingCurve, PointsComeBackBehindThoseOfAnEarlierRun) {
  const TempDir dir;
  const auto path = dir / "curve.csv";
  for (const std::uint64_t step : {100u, 200u}) {
    nerf::TrainingCurve curve(path);
    curve.Add({.step = step,
               .wall_s = 0.5,
               .cpu_s = 1,
               .loss = 0.25,
               .train_psnr = 20,
               .heldout_psnr = std::nan("")});
    curve.Write();
  }
  const nerf::CurveColumns read = nerf::ReadTrainingCurve(path);
  EXPECT_EQ(read.step, (std::vector<double>{100, 200}));
  EXPECT_EQ(read.wall_s, (std::vector<double>{0.5, 0.5}));
  EXPECT_EQ(read.cpu_s, (std::vector<double>{1, 1}));
  EXPECT_EQ(read.loss, (std::vector<double>{0.25, 0.25}));
  EXPECT_EQ(read.train_psnr, (std::vector<double>{20, 20}));
  ASSERT_EQ(read.heldout_psnr.size(), 2u);
  EXPECT_TRUE(std::isnan(read.heldout_psnr[1]));
}

TEST(TrainingCurve, ColumnsAreFoundByNameAndEmptyCellsAreNan) {
  const TempDir dir;
  EXPECT_TRUE(nerf::ReadTrainingCurve(dir / "curve.csv").step.empty());
  WriteText(dir / "curve.csv", "loss,step\n,1\n0.5\n");
  const nerf::CurveColumns read = nerf::ReadTrainingCurve(dir / "curve.csv");
  ASSERT_EQ(read.step.size(), 2u);
  EXPECT_EQ(read.step[0], 1);
  EXPECT_TRUE(std::isnan(read.step[1]));
  EXPECT_TRUE(std::isnan(read.loss[0]));
  EXPECT_EQ(read.loss[1], 0.5);
  EXPECT_TRUE(std::isnan(read.wall_s[0]));
}

}  // namespace
