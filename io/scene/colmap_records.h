// The raw contents of a COLMAP sparse model as its files state them, before references and numbers are
// verified (io/scene/colmap_model.h does that). Layout: https://colmap.github.io/format.html; equal from
// COLMAP 3.8 to 4.x.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/base/error.h"

namespace io {

struct ColmapCameraRecord {
  std::uint32_t id = 0;
  std::string model;  // "SIMPLE_RADIAL"; "#99" for a number COLMAP does not define
  std::uint64_t width = 0, height = 0;
  std::vector<double> params;
};

// One detected feature; point_id is kNoPoint when it was not triangulated.
struct ColmapFeatureRecord {
  double x = 0, y = 0;
  std::uint64_t point_id = 0;
};
constexpr std::uint64_t kNoPoint = ~std::uint64_t{0};

struct ColmapImageRecord {
  std::uint32_t id = 0, camera_id = 0;
  std::array<double, 4> quaternion_wxyz = {};  // cam_from_world, OpenCV axes
  std::array<double, 3> translation = {};
  std::string name;
  std::vector<ColmapFeatureRecord> features;
};

struct ColmapTrackElement {
  std::uint32_t image_id = 0, feature_index = 0;
};

struct ColmapPointRecord {
  std::uint64_t id = 0;
  std::array<double, 3> xyz = {};
  std::array<std::uint8_t, 3> rgb = {};
  double error_px = 0;
  std::vector<ColmapTrackElement> track;
};

struct ColmapRecords {
  std::filesystem::path cameras_path, images_path, points_path;
  std::vector<ColmapCameraRecord> cameras;
  std::vector<ColmapImageRecord> images;
  std::vector<ColmapPointRecord> points;
};

// Throws kBadState: `what` is wrong in the file `path`.
[[noreturn]] void RefuseModel(const std::filesystem::path& path, const std::string& what);

// Number of parameters of a camera model, or -1 for a name COLMAP does not define.
int ColmapParamCount(const std::string& model);

// COLMAP's number of a camera model that it defines.
int ColmapModelNumber(const std::string& model);

// Binary files are preferred where both exist, as in COLMAP. Every count is checked against the bytes that
// remain before anything is allocated, and every file must end where its last record ends. Throws kBadState
// naming file and record, kBadInput when the folder holds no model.
ColmapRecords ReadColmapRecords(const std::filesystem::path& folder);

}  // namespace io
