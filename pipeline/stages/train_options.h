// The options of `pipeline train`: flags bound to nerf::TrainOptions, presets, and their checks.
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
  std::string field = "hash", density = "softplus", initialisation = "xavier", encoding_space = "cube", precision = "auto";
  bool positional_encoding = true, identity = true;
};

void AddTrainOptions(Options* options, TrainFlags* flags);

// Sets the values of flags.preset, then reads flags and file again, which win. Throws kUsage naming an
// unknown preset.
void ApplyPreset(int argc, const char* const* argv, Options* options, TrainFlags* flags);

// The resolved options. Throws kUsage naming what is out of range or unknown.
nerf::TrainOptions ResolvedTrainOptions(const Options& options, const TrainFlags& flags);

}  // namespace pipeline
