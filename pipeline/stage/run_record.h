// run.json: the run's options and commands, versions, host, and one entry per stage. Read, changed and
// replaced as a whole.
#pragma once

#include <filesystem>
#include <string>

namespace pipeline {

// Replaces the entry of `stage_name` by the JSON object `entry_json`; creates run.json when absent. Called
// while the stage lock of the folder is held.
void RecordStage(const std::filesystem::path& run_folder,
                 const std::string& stage_name,
                 const std::string& entry_json);

// The entry of `stage_name` as JSON text; empty when absent.
std::string ReadStageEntry(const std::filesystem::path& run_folder, const std::string& stage_name);

// Merges the members of the JSON object `members_json` into run.json. Takes the stage lock meanwhile.
void RecordRun(const std::filesystem::path& run_folder, const std::string& members_json);

// The record of a finished stage, <run>/<folder>/<folder>.json as JSON text; empty when absent.
std::string ReadStageRecord(const std::filesystem::path& run_folder, const std::string& stage_name);

}  // namespace pipeline
