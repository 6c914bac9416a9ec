// run.json: the run's options and commands, versions, host, and one entry per stage. Read, changed and
// replaced as a whole.
#pragma once

#include <filesystem>
#include <string>
#include "io/base/json.h"

namespace pipeline {

// Replaces the entry of `stage_name` by an object; creates run.json when absent. Called while the stage lock
// of the folder is held.
void RecordStage(const std::filesystem::path& run_folder,
                 const std::string& stage_name,
                 const io::Json& entry);

// The entry of `stage_name`; null when absent.
io::Json ReadStageEntry(const std::filesystem::path& run_folder, const std::string& stage_name);

// Merges the members of an object into run.json. Takes the stage lock meanwhile.
void RecordRun(const std::filesystem::path& run_folder, const io::Json& members);

// The record of a finished stage, the object in <run>/<folder>/<folder>.json; null when there is none or it
// is no JSON object.
io::Json ReadStageRecord(const std::filesystem::path& run_folder, const std::string& stage_name);

// A member of a record that may have been edited or damaged: `otherwise`, or empty, where `json` is no
// object, lacks the member or has another type there.
double NumberAt(const io::Json& json, const char* key, double otherwise = 0);
std::string TextAt(const io::Json& json, const char* key);

}  // namespace pipeline
