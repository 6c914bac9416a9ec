// Trains a field on a scene within a time budget or for a number of steps.
#pragma once

#include <filesystem>

#include "io/scene/scene.h"
#include "nerf/steps/train_options.h"
#include "nerf/training/train_report.h"

namespace nerf {

// Writes checkpoint.bin and curve.csv into `folder`; continues from them when they are there. heldout may
// have no frames. Several ranks (io/process/ranks.h) train the same field; rank 0 alone writes, monitors, and
// decides by its clock. On a pending interrupt it writes a checkpoint and throws io::Interrupted. Throws
// kNumeric when the loss stays non-finite, naming step, ray and seed, and kNoResources, before pictures are
// read, when options.memory does not suffice for them and the field.
TrainReport Train(const io::Scene& scene,
                  const io::Scene& heldout,
                  const TrainOptions& options,
                  const std::filesystem::path& folder);

}  // namespace nerf
