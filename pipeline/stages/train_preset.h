// The presets of `pipeline train`. Apart from its options, so that `pipeline run` can check those without
// loading what training needs.
#pragma once

#include "pipeline/stages/train_options.h"

namespace pipeline {

// Sets the values of flags.preset, then reads flags and file again, which win.
void ApplyPreset(int argc, const char* const* argv, Options* options, TrainFlags* flags);

}  // namespace pipeline
