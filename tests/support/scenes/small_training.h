// Options of trainings that take seconds.
#pragma once

#include "nerf/steps/train_options.h"

namespace tests {

// Of a small field, on two threads.
inline nerf::TrainOptions SmallTraining(int steps) {
  nerf::TrainOptions options;
  options.steps = steps;
  options.samples_per_step = 8192;
  options.threads = 2;
  options.field.log2_hashmap_size = 12;
  options.field.finest_resolution = 64;
  options.field.grid_resolution = 64;
  return options;
}

}  // namespace tests
