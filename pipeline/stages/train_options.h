// The options of `pipeline train`: flags bound to nerf::TrainOptions, and their ranges.
#pragma once

#include <string>

#include "nerf/training/trainer.h"
#include "pipeline/stage/options.h"

namespace pipeline {

struct TrainFlags {
  nerf::TrainOptions train;
  std::string preset, time = "3m", target;
  int batch = 0;
  // Text of what has names.
  std::string field = "hash", density = "softplus", initialisation = "xavier", encoding_space = "cube",
              precision = "auto";
  bool positional_encoding = true, identity = true;
};

void AddTrainOptions(Options* options, TrainFlags* flags);

// The resolved options. Throws kUsage naming options that do not go together.
nerf::TrainOptions ResolvedTrainOptions(const Options& options, const TrainFlags& flags);

}  // namespace pipeline
