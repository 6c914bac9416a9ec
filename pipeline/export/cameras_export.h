// Cameras, pictures and sparse points of a run in the formats of other programs, in one folder:
//   images/, masks/           the pictures that the poses belong to
//   transforms.json           nerfstudio: all frames, training frames first
//   transforms_train.json, transforms_test.json   as the NeRF-synthetic scenes
//   points.ply                sparse points, coloured
//   colmap_text/, colmap_bin/ COLMAP models of all frames; points are observed where the poses project them
#pragma once

#include <filesystem>

#include "pipeline/export/exported_scene.h"

namespace pipeline {

// Throws kNoResources.
void ExportCameras(const ExportedScene& scene, const std::filesystem::path& folder);

}  // namespace pipeline
