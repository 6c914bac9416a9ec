// scene.json: what `pipeline normalize` records of the scene that it made.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/pose_source.h"
#include "sfm/scene/normalize.h"

namespace pipeline {

// What later stages read of it.
struct SceneRecord {
  std::string protocol = "capture";  // which views are held out, and how they are compared (README.md)
  int masks = 0;                     // pictures that have one
  double used_share = 0;             // of all pixels, where there are masks
};

// Adds the members to the record of `stage`. source: as the stage writes it, with a split for each frame.
// report: nothing when the scene was not moved.
void WriteSceneRecord(const SceneRecord& record,
                      const PoseSource& source,
                      const std::optional<sfm::NormalizeReport>& report,
                      StageRun* stage);

// Members that the file lacks, or all of them when it is absent, keep their defaults. Throws kBadInput naming
// the file and the place when a member is of another type.
SceneRecord ReadSceneRecord(const std::filesystem::path& run_folder);

}  // namespace pipeline
