// A checkpoint belongs to the scene that it was trained on: another one would be rendered without a word.
#pragma once

#include <filesystem>

#include "io/scene/scene.h"
#include "pipeline/stage/stage_run.h"

namespace pipeline {

// Throws kBadState naming the file, unless `checkpoint`, an input of `stage`, is the one that `train`
// recorded in this run folder, and the inputs that `stage` shares with that record are unchanged since.
void RequireTrainedOnThisScene(const StageRun& stage, const std::filesystem::path& checkpoint);
// The same for what is no stage; input_hashes: as HashTree makes them, the checkpoint among them.
void RequireTrainedOnThisScene(const std::filesystem::path& run_folder,
                               const std::map<std::string, std::string>& input_hashes,
                               const std::filesystem::path& checkpoint);

// scene/transforms_train.json, with the masks that training made for pictures of its own
// (nerf/training/transient_masks.h) in place of what they had.
io::Scene ReadTrainingScene(const std::filesystem::path& run_folder);
// Where in the stage's folder the mask is that training made for a frame, if it made one.
std::filesystem::path TrainingMaskPath(const std::filesystem::path& train_folder, const io::Frame& frame);

}  // namespace pipeline
