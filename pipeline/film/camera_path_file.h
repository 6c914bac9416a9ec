// camera_path.json of nerfstudio's viewer: keyframes, the cameras of every frame of the film, and a crop box.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "nerf/paths/keyframe_path.h"
#include "nerf/sampling/crop_box.h"

namespace pipeline {

// What lies outside the box is not filmed; the background shows there, sRGB in [0, 1].
struct Crop {
  nerf::CropBox box;
  std::array<float, 3> background = {0, 0, 0};
};

struct CameraPathFile {
  std::vector<nerf::Keyframe> keyframes;  // may be empty: then nobody can edit the path
  std::vector<nerf::Keyframe> frames;     // poses in the coordinates of scene/transforms_train.json
  int width = 0, height = 0;              // of the film [px]
  double fps = 30;
  bool is_loop = false;
  std::optional<Crop> crop;
};

// A file without frames gets them from its keyframes, as many as "seconds" and "fps" say. Throws kBadInput
// naming the file and the place: fewer than 2 frames, more than kMaxPathFrames, a pose that is not rigid, an
// angle of view or a size out of range, a box without extent, another camera than a perspective one.
CameraPathFile ReadCameraPath(const std::filesystem::path& path);
// The same of a text, which may hold a crop box alone; `name` stands for it in messages.
CameraPathFile ParseCameraPath(const std::string& text, const std::string& name);

// The crop box of such a file, which need not have frames. Throws kBadInput also when it has no box.
Crop ReadCrop(const std::filesystem::path& path);
// The value of such a file's "crop".
Crop ParseCrop(const std::string& text, const std::string& name);

// A file without frames only keeps the crop box.
void WriteCameraPath(const std::filesystem::path& path, const CameraPathFile& file);

inline constexpr int kMaxPathFrames = 216000;           // an hour at 60 frames per second
inline constexpr int kMaxPathSide = 7680;               // 8K
inline constexpr double kMinFov = 0.02, kMaxFov = 2.8;  // radians: 1 to 160 degrees

// Throws kBadInput with `where`, unless the matrix [4][4] or [3][4], by rows, is a rigid transform.
io::Rigid3d PoseFromRows(const std::vector<double>& matrix, const std::string& where);
// [4][4] by rows.
std::vector<double> RowsOf(const io::Rigid3d& pose);

}  // namespace pipeline
