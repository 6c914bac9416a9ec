// A checkpoint belongs to the scene that it was trained on: another one would be rendered without a word.
#pragma once

#include <filesystem>

#include "pipeline/stage/stage_run.h"

namespace pipeline {

// Throws kBadState naming the file, unless `checkpoint`, an input of `stage`, is the one that `train`
// recorded in this run folder, and the inputs that `stage` shares with that record are unchanged since.
void RequireTrainedOnThisScene(const StageRun& stage, const std::filesystem::path& checkpoint);
// The same for what is no stage; input_hashes: as HashTree makes them, the checkpoint among them.
void RequireTrainedOnThisScene(const std::filesystem::path& run_folder,
                               const std::map<std::string, std::string>& input_hashes,
                               const std::filesystem::path& checkpoint);

}  // namespace pipeline
