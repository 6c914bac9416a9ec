// Poses that are known from elsewhere, to measure ours against.
#pragma once

#include <filesystem>

#include "io/scene/scene.h"

namespace pipeline {

// path: a transforms.json, or a folder of *.camera files as in the multi-view benchmark of Strecha et al.,
// "On benchmarking camera calibration and multi-view stereo for high resolution imagery", CVPR 2008: K (3x3),
// three zeros, the rotation world_from_cam (3x3, x right, y down, z forward), the centre, width and height.
// Image paths are file names. Throws kBadInput naming the file when something is missing or no rotation.
io::Scene ReadTruePoses(const std::filesystem::path& path);

}  // namespace pipeline
