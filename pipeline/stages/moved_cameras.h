// The record of the cameras that training moved.
#pragma once

#include <filesystem>
#include <vector>

#include "nerf/training/trainer.h"

namespace pipeline {

// {"frames": [{"name", "moved_px", "transform_matrix"}]}, the matrix as in transforms.json: camera to scene,
// 4x4 by rows.
void WriteMovedCameras(const std::filesystem::path& path, const std::vector<nerf::MovedCamera>& cameras);

}  // namespace pipeline
