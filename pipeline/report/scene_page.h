// The page that plays the scene, beside the report.
#pragma once

#include <filesystem>
#include <string>

namespace pipeline {

// <run>/scene.html
std::filesystem::path ScenePagePath(const std::filesystem::path& run_folder);

// Writes it when the run has a field that a browser can show; else removes one that an earlier field left.
// Returns one line for the record, empty when there is nothing to say. Throws kBadState for a damaged
// checkpoint, kNoResources for a full disk.
std::string WriteScenePage(const std::filesystem::path& run_folder);

}  // namespace pipeline
