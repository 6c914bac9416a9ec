// How far a run is by steps or by time, and how it winds down when it is asked to end.
#include "nerf/training/training_progress.h"

#include <gtest/gtest.h>

namespace nerf {
namespace {

TEST(TrainingProgress, IsTheShareOfStepsOrElseOfTime) {
  const TrainingProgress progress(0, 200), by_steps(10, 200);
  EXPECT_DOUBLE_EQ(progress.At(7, 50), 0.25);
  EXPECT_DOUBLE_EQ(progress.LeftSeconds(7, 50), 150);
  EXPECT_DOUBLE_EQ(progress.At(7, 300), 1);
  EXPECT_DOUBLE_EQ(by_steps.At(4, 50), 0.4);
  EXPECT_DOUBLE_EQ(by_steps.LeftSeconds(4, 50), 75);
}

TEST(TrainingProgress, GoesThroughTheRestInAShareOfTheTimeSoFar) {
  TrainingProgress progress(0, 200), early = progress, late = progress;
  progress.End(0, 100);
  EXPECT_DOUBLE_EQ(progress.At(0, 100), 0.5);
  EXPECT_DOUBLE_EQ(progress.At(0, 107.5), 0.75);
  EXPECT_DOUBLE_EQ(progress.LeftSeconds(0, 107.5), 7.5);
  EXPECT_DOUBLE_EQ(progress.At(0, 115), 1);

  early.End(0, 2);
  EXPECT_DOUBLE_EQ(early.LeftSeconds(0, 2), 1);  // at least a second ...
  late.End(0, 199.5);
  EXPECT_DOUBLE_EQ(late.LeftSeconds(0, 199.5), 0.5);  // ... but never longer than without
}

}  // namespace
}  // namespace nerf
