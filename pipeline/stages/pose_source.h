// Pictures with poses, from wherever they come: our own sfm stage, a transforms.json, or a COLMAP model.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace pipeline {

struct PoseSource {
  io::Scene scene;  // image paths absolute, every picture exists and has its camera's size
  std::vector<std::string>
      splits;                  // of each frame: "train", "val" or "test"; empty when the source has no split
  bool is_blender = false;     // NeRF-synthetic files, whose world is already near 2, far 6
  bool is_normalised = false;  // written by us: near, far and aabb are stated
  std::vector<std::string> missing_images, notes;
  std::vector<std::filesystem::path>
      files;  // what was read, pictures and masks included: the inputs of the stage
};

// poses: a transforms.json, a folder with transforms.json or transforms_{train,val,test}.json, a COLMAP
// model, or a folder with a COLMAP model in sparse/ (of several the one with most pictures). images: the
// pictures of a COLMAP model; empty: `images` beside or one or two levels above the model. Throws kBadInput
// naming what is missing.
PoseSource ReadPoses(const std::filesystem::path& poses, const std::filesystem::path& images);

// The result of `pipeline sfm`: cameras and undistorted pictures from transforms.json, points with their
// tracks from the largest model. Throws kBadInput when the stage has not run.
PoseSource ReadSfmPoses(const std::filesystem::path& sfm_folder);

}  // namespace pipeline
