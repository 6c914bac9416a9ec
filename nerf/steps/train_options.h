// How to train.
#pragma once

#include <functional>
#include <optional>

#include "io/base/memory.h"
#include "nerf/fields/scene_field.h"
#include "nerf/steps/training_schedule.h"

namespace nerf {

inline constexpr double kMlpLearningRate = 2e-3;

// What only the `nerf` field has. The defaults train best; ReportTrainOptions() has the report's values.
struct MlpTrainOptions {
  int rays = 4096;  // per step, at most: with the occupancy grid, samples_per_step limits them as well
  int samples_per_step = 1 << 12;
  double learning_rate_final = 0.1;  // last rate / first rate, falling exponentially; 1: constant
  // Steps over which the rate rises to the first one. Without, 6 of 8 seeds on a mostly white scene overshot
  // into empty space and stayed there; with it none did (tests/nerf/training/mlp_faults_test.cpp).
  int learning_rate_warm_up = 256;
  double first_step_scale = 2.5;  // sampling intervals start this much longer ...
  double step_scale_share = 0.3;  // ... and shrink to 1 within this share of the run
  bool white_background = false;  // pictures with alpha on white only, as the report; else on all backgrounds
};

// How training goes, for whoever watches it.
struct TrainingNews {
  std::uint64_t step = 0;
  double progress = 0;   // share of the budget
  double elapsed_s = 0;  // of training
  double left_s = 0;     // until the budget is used; NaN for a number of steps that has just begun
  double train_psnr = 0, heldout_psnr = 0;  // heldout_psnr: 0 before it was first measured
};
// What a watcher asks for.
struct WatcherWish {
  bool wants_checkpoint = false;  // now, as far as kWatchedShare allows
  bool wants_end = false;         // soon: the rest of the schedule in a fraction of the time so far
};

struct TrainOptions {
  double time_s = 180;     // training budget in seconds; schedules follow the share of it that is used
  double target_psnr = 0;  // > 0: training ends as soon as the monitored held-out views reach it [dB]
  int steps = 0;  // > 0: this many steps instead; the result then depends on nothing but seed and inputs
  std::uint64_t seed = 1;
  int threads = 1;
  io::MemoryBudget memory = io::MemoryBudget();
  double learning_rate = 0;        // Adam; 0: the field's own, above
  int samples_per_step = 1 << 14;  // `hash`: target; the number of rays follows from the samples they meet
  bool refine_cameras = true;      // `hash`, photographs: move the poses that their rays pull at
  bool find_transients = true;     // `hash`, photographs: leave out what one picture alone shows
  bool splats = true;              // `hash`, photographs: fit splats in the second part of the budget
  double min_weight = 1e-4;        // `hash`: samples with less weight are not differentiated
  std::optional<TrainingSchedule> schedule;  // `hash`; otherwise by what time or steps afford
  double checkpoint_every_s = 60;
  std::function<WatcherWish(const TrainingNews&)> watcher;  // called twice a second; may be empty
  SceneFieldOptions field;
  MlpTrainOptions mlp;
};

// options.schedule, or the best known for options.time_s or options.steps; with the rate and the table size
// that were given. Without alpha, as photographs are, several rays per pixel gained nothing
// (nerf/EXPERIMENTS.md).
TrainingSchedule ScheduleOf(const TrainOptions& options, bool has_alpha);

// The report's values in all options that it determines: corners, ReLU density, uniform start, constant rate,
// 192 stratified samples with an open end on [near, far], 4096 rays, white background, 100,000 steps.
TrainOptions ReportTrainOptions();

}  // namespace nerf
