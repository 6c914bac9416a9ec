// COLMAP as its own user runs it: the reference points of the sweep.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/process/resource_meter.h"
#include "io/scene/colmap_model.h"

namespace pipeline {

struct ColmapPreset {
  std::string name;
  int features = 0, size = 0;  // per picture, and longest side [px]; 0: COLMAP's default
};

// "COLMAP default", and the setting that users without a GPU arrive at.
std::vector<ColmapPreset> ColmapPresets();

// feature_extractor, exhaustive_matcher and mapper on the pictures of `images` with COLMAP's own options but
// for the preset's, the CPU in place of the GPU, and `single_camera`. work: private, emptied before and
// after. model: the largest one. Throws kMissingTool when COLMAP is missing or fails, kNotReconstructible
// when it finds no model.
io::ColmapModel RunColmapPreset(const ColmapPreset& preset,
                                const std::filesystem::path& images,
                                bool single_camera,
                                const std::filesystem::path& work,
                                io::ResourceUse* use);

}  // namespace pipeline
