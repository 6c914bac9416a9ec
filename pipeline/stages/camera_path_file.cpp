#include "pipeline/stages/camera_path_file.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json_reader.h"

namespace pipeline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegree = std::numbers::pi / 180;
// Largest deviation of a rotation from orthonormal; files with 4 digits have 1e-4.
constexpr double kRigidTolerance = 1e-3;

nerf::Keyframe ReadView(const io::JsonReader& json, const char* matrix_key) {
  const io::JsonReader matrix = json.At(matrix_key);
  std::vector<double> rows;
  for (std::size_t i = 0; i < matrix.Size(); ++i)
    rows.push_back(matrix.At(i).Number(-io::kMaxCoordinate, io::kMaxCoordinate));
  return {PoseFromRows(rows, matrix.json_path()),
          json.At("fov").Number(kMinFov / kDegree, kMaxFov / kDegree) * kDegree};
}

CameraPathFile FromJson(const io::JsonReader& json) {
  CameraPathFile file;
  file.width = json.At("render_width").Integer(1, kMaxPathSide);
  file.height = json.At("render_height").Integer(1, kMaxPathSide);
  file.fps = json.At("fps").Number(1, 240);
  if (json.Has("is_cycle")) file.is_loop = json.At("is_cycle").Bool();
  if (json.Has("camera_type") && json.At("camera_type").String() != "perspective")
    json.At("camera_type").Fail("is not \"perspective\"", "Other cameras cannot be rendered");
  if (json.Has("crop") && !json.At("crop").IsNull())
    json.At("crop").Fail("cannot be rendered", "Take the crop box out of the path");
  const std::size_t n_keyframes = json.Has("keyframes") ? json.At("keyframes").Size() : 0;
  if (n_keyframes > kMaxPathFrames) json.At("keyframes").Fail("are too many");
  for (std::size_t i = 0; i < n_keyframes; ++i)
    file.keyframes.push_back(ReadView(json.At("keyframes").At(i), "matrix"));
  if (!json.Has("camera_path") && n_keyframes > 0) {
    const double frames = file.fps * json.At("seconds").Number(0.01, 3600);
    file.frames = nerf::InterpolateKeyframes(
        file.keyframes, std::clamp(static_cast<int>(std::lround(frames)), 2, kMaxPathFrames), file.is_loop);
    return file;
  }
  const io::JsonReader frames = json.At("camera_path");
  if (frames.Size() < 2 || frames.Size() > kMaxPathFrames)
    frames.Fail("has too few or too many frames", "Give 2 to " + std::to_string(kMaxPathFrames));
  for (std::size_t i = 0; i < frames.Size(); ++i)
    file.frames.push_back(ReadView(frames.At(i), "camera_to_world"));
  return file;
}

}  // namespace

io::Rigid3d PoseFromRows(const std::vector<double>& matrix, const std::string& where) {
  const auto refuse = [&](const char* what) {
    throw io::Error(io::ExitCode::kBadInput, where + ": " + what, "Give camera to scene, by rows");
  };
  if (matrix.size() != 12 && matrix.size() != 16) refuse("is not a matrix of 3x4 or 4x4");
  io::Rigid3d pose;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double value = matrix[static_cast<std::size_t>(4 * row + column)];
      if (!(std::abs(value) <= io::kMaxCoordinate)) refuse("has a value out of range");
      (column < 3 ? pose.rotation(row, column) : pose.translation[row]) = value;
    }
  }
  const Eigen::Matrix3d product = pose.rotation * pose.rotation.transpose();
  if (!((product - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= kRigidTolerance) ||
      pose.rotation.determinant() < 0)
    refuse("is not a rigid transform");
  pose.rotation = Eigen::Quaterniond(pose.rotation).normalized().toRotationMatrix();
  return pose;
}

std::vector<double> RowsOf(const io::Rigid3d& pose) {
  std::vector<double> rows;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rows.push_back(pose.rotation(row, column));
    rows.push_back(pose.translation[row]);
  }
  rows.insert(rows.end(), {0, 0, 0, 1});
  return rows;
}

CameraPathFile ReadCameraPath(const std::filesystem::path& path) {
  return FromJson(io::JsonReader::ReadDocument(path));
}

CameraPathFile ParseCameraPath(const std::string& text, const std::string& name) {
  return FromJson(io::JsonReader::ParseDocument(text, name));
}

void WriteCameraPath(const std::filesystem::path& path, const CameraPathFile& file) {
  const double aspect = static_cast<double>(file.width) / file.height;
  const double default_fov = file.frames.front().fov_y / kDegree;
  Json json = {{"camera_type", "perspective"},
               {"default_fov", default_fov},
               {"render_height", file.height},
               {"render_width", file.width},
               {"fps", file.fps},
               {"seconds", static_cast<double>(file.frames.size()) / file.fps},
               {"smoothness_value", 0.5},
               {"is_cycle", file.is_loop},
               {"crop", nullptr},
               {"keyframes", Json::array()},
               {"camera_path", Json::array()}};
  const auto add = [&](const char* list, const char* matrix_key, const nerf::Keyframe& view) {
    json[list].push_back(
        {{matrix_key, RowsOf(view.world_from_cam)}, {"fov", view.fov_y / kDegree}, {"aspect", aspect}});
  };
  for (const nerf::Keyframe& view : file.keyframes) add("keyframes", "matrix", view);
  for (const nerf::Keyframe& view : file.frames) add("camera_path", "camera_to_world", view);
  io::WriteFileAtomically(path, json.dump(1) + "\n");
}

}  // namespace pipeline
