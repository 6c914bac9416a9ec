// COLMAP sparse models (cameras, images, points3D; binary or text). The reader is ours because COLMAP's
// accepts truncated files, NaN poses and dangling references without a word: every count is checked against
// the bytes that remain before anything is allocated, every reference and number is verified.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "io/scene.h"

namespace io {

struct ColmapModel {
  Scene scene;  // OpenGL axes, frames sorted naturally by name; image_path is the picture's name; points
                // carry tracks
  std::string camera_model;  // COLMAP's name of the (first) camera model
  double mean_reprojection_error_px = 0;
  double mean_track_length = 0;
};

// True when the folder holds cameras, images and points3D as .bin or .txt.
bool IsColmapModel(const std::filesystem::path& folder);

// Throws kBadState naming the file and the image, camera or point at fault. Supports SIMPLE_PINHOLE, PINHOLE,
// SIMPLE_RADIAL, RADIAL and OPENCV; other camera models throw kBadInput ("undistort first").
ColmapModel ReadColmapModel(const std::filesystem::path& folder);

}  // namespace io
