// run.json: versions, host and one entry per stage. Read, changed and replaced as a whole while the folder
// lock is held.
#pragma once

#include <filesystem>
#include <string>

namespace pipeline {

// Replaces the entry of `stage_name` by the JSON object `entry_json`; creates run.json when absent.
void RecordStage(const std::filesystem::path& run_folder,
                 const std::string& stage_name,
                 const std::string& entry_json);

}  // namespace pipeline
