// The schedule of the `hash` field: its ends, its monotony, and capacity that grows with the budget.
#include "nerf/steps/training_schedule.h"

#include <gtest/gtest.h>

#include "nerf/training/trainer.h"

namespace nerf {
namespace {

TEST(TrainingSchedule, StartsAndEndsWhereItSaysAndNeverRises) {
  for (const double n_samples : {1e6, 5e7, 1.2e8, 1e9}) {
    const TrainingSchedule schedule = ScheduleFor(n_samples);
    EXPECT_EQ(schedule.LearningRate(0), schedule.learning_rate);
    EXPECT_EQ(schedule.LearningRate(schedule.hold), schedule.learning_rate);
    EXPECT_NEAR(schedule.LearningRate(1), schedule.learning_rate * schedule.last_rate, 1e-12);
    EXPECT_EQ(schedule.StepScale(0), schedule.first_step_scale);
    EXPECT_NEAR(schedule.StepScale(schedule.step_scale_share), 1, 1e-12);
    EXPECT_NEAR(schedule.StepScale(1), 1, 1e-12);
    EXPECT_EQ(schedule.SamplesPerPixel(0), 1);
    EXPECT_EQ(schedule.SamplesPerPixel(0.699), 1);
    EXPECT_EQ(schedule.SamplesPerPixel(0.701), n_samples > 1e8 ? 4 : 1);
    for (int i = 0; i < 100; ++i) {
      EXPECT_GE(schedule.LearningRate(0.01 * i), schedule.LearningRate(0.01 * (i + 1)));
      EXPECT_GE(schedule.StepScale(0.01 * i), schedule.StepScale(0.01 * (i + 1)));
    }
  }
  EXPECT_EQ((TrainingSchedule{.hold = 1}.LearningRate(1)), TrainingSchedule{}.learning_rate);
}

TEST(TrainingSchedule, CapacityGrowsWithTheBudget) {
  TrainingSchedule before = ScheduleFor(1e6);
  for (const double n_samples : {6e7, 2e8, 1e9}) {
    const TrainingSchedule schedule = ScheduleFor(n_samples);
    EXPECT_GT(schedule.log2_hashmap_size, before.log2_hashmap_size);
    EXPECT_LE(schedule.finest_cell_pixels, before.finest_cell_pixels);
    EXPECT_NE(schedule.Text(), before.Text());
    before = schedule;
  }
  EXPECT_LT(before.finest_cell_pixels, ScheduleFor(1e6).finest_cell_pixels);
}

TEST(TrainingSchedule, FollowsStepsOrTimeAndThreadsUnlessGiven) {
  TrainOptions options;
  options.steps = 100;
  options.samples_per_step = 1 << 14;
  EXPECT_EQ(ScheduleOf(options, true).log2_hashmap_size, ScheduleFor(100 << 14).log2_hashmap_size);
  options.steps = 0;
  options.threads = 2;
  // 50, 100, 140 and 300 million samples are 16.7, 33.3, 46.7 and 100 seconds.
  struct Budget {
    double time_s;
    int log2_hashmap_size, samples_per_pixel;
  };
  for (const Budget& budget : {Budget{16, 16, 1},
                               Budget{17, 17, 1},
                               Budget{33, 17, 1},
                               Budget{34, 17, 4},
                               Budget{46, 17, 4},
                               Budget{47, 18, 4},
                               Budget{99, 18, 4},
                               Budget{101, 19, 4}}) {
    options.time_s = budget.time_s;
    const TrainingSchedule schedule = ScheduleOf(options, true);
    EXPECT_EQ(schedule.log2_hashmap_size, budget.log2_hashmap_size) << budget.time_s;
    EXPECT_EQ(schedule.SamplesPerPixel(1), budget.samples_per_pixel) << budget.time_s;
  }
  options.time_s = 3600;
  EXPECT_EQ(ScheduleOf(options, true).log2_hashmap_size, ScheduleFor(1e9).log2_hashmap_size);
  options.schedule = TrainingSchedule{.log2_hashmap_size = 11};
  EXPECT_EQ(ScheduleOf(options, true).log2_hashmap_size, 11);
  options.field.log2_hashmap_size = 12;
  options.learning_rate = 0.125;
  EXPECT_EQ(ScheduleOf(options, true).log2_hashmap_size, 12);
  const std::string text = ScheduleOf(options, true).Text();
  EXPECT_NE(
      text.find("tables of 2^12 entries, finest cells of 0.9 pixels; moments per value; rate 0.125 for 60 %"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("4 rays per pixel"), std::string::npos) << text;
  EXPECT_EQ(ScheduleOf(options, false).Text().find("rays per pixel"), std::string::npos);
}

}  // namespace
}  // namespace nerf
