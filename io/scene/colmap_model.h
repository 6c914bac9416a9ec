// COLMAP sparse models (cameras, images, points3D; in binary or text). The reader is ours because COLMAP's
// accepts truncated files, NaN poses and dangling references without a word: every count is checked against
// the bytes that remain before anything is allocated, every reference and number is verified.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace io {

// Where a frame shows a point, in pixels; the centre of the top-left pixel is (0.5, 0.5).
struct Observation {
  int frame_index = 0, point_index = 0;
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  double sigma = 1;  // standard deviation relative to the other observations; not stored in files

  bool operator==(const Observation&) const = default;
};

struct ColmapModel {
  Scene scene;  // OpenGL axes, frames sorted naturally by name; image_path is the picture's name; points
                // carry tracks
  // Point by point; those of one point in the order of its track, Point3D::frame_indices.
  std::vector<Observation> observations;
  std::string camera_model;  // COLMAP's name of the (first) camera model
  double mean_reprojection_error_px = 0;
  double mean_track_length = 0;
};

// Where the poses say that a frame of the scene shows the observed point; nothing when it is not in front of
// the camera.
std::optional<Eigen::Vector2d> Project(const Scene& scene, const Observation& observation);

// True when the folder holds cameras, images and points3D as .bin or .txt.
bool IsColmapModel(const std::filesystem::path& folder);

// Throws kBadState naming the file and the image, camera or point at fault. Supports SIMPLE_PINHOLE, PINHOLE,
// SIMPLE_RADIAL, RADIAL and OPENCV; other camera models throw kBadInput ("undistort first").
ColmapModel ReadColmapModel(const std::filesystem::path& folder);

enum class ColmapForm { kText, kBinary };

// Writes cameras, images and points3D, in text with 17 significant digits; features without a point are not
// kept. Each camera gets the simplest model that holds its parameters exactly. ReadColmapModel returns the
// same model, up to rounding of the poses (COLMAP stores quaternion and translation). image_ids: COLMAP's
// numbers of the frames; empty: counted from 1. Throws kNoResources when a file cannot be written.
void WriteColmapModel(const std::filesystem::path& folder,
                      const ColmapModel& model,
                      ColmapForm form = ColmapForm::kText,
                      const std::vector<std::uint32_t>& image_ids = {});

}  // namespace io
