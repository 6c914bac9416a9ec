// The stages, in the order in which `pipeline run` chains them.
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace pipeline {

struct StageEntry {
  const char* name;
  const char* help;
  const char* folder;  // output folder inside the run folder; its record is <folder>/<folder>.json
  const char* inputs;  // for --help and README
  const char* outputs;
  bool is_shared = false;  // out over several ranks
};

// ingest, sfm, normalize, train, evaluate, render, report, in this order.
std::span<const StageEntry> StageTable();

// The row of a stage, which must exist.
const StageEntry& FindStage(const std::string& name);

// Absolute path of `pipeline-<name>`, the program of a stage or command, beside the running executable.
// Throws kMissingTool when it is not there.
std::filesystem::path ProgramOf(const std::string& name);

}  // namespace pipeline
