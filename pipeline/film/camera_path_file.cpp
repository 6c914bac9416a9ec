#include "pipeline/film/camera_path_file.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/json_reader.h"

namespace pipeline {
namespace {

using io::Json;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kDefaultFov = 50;  // degrees; written to files without frames
// Largest deviation of a rotation from orthonormal; files with 4 digits have 1e-4.
constexpr double kRigidTolerance = 1e-3;
constexpr double kMinCropSide = 1e-6;

nerf::Keyframe ReadView(const io::JsonReader& json, const char* matrix_key) {
  const io::JsonReader matrix = json.At(matrix_key);
  std::vector<double> rows;
  for (std::size_t i = 0; i < matrix.Size(); ++i)
    rows.push_back(matrix.At(i).Number(-io::kMaxCoordinate, io::kMaxCoordinate));
  return {PoseFromRows(rows, matrix.json_path()),
          json.At("fov").Number(kMinFov / kDegree, kMaxFov / kDegree) * kDegree};
}

Eigen::Vector3d ReadVector(const io::JsonReader& json, double min, double max) {
  if (json.Size() != 3) json.Fail("does not have 3 numbers");
  return {json.At(std::size_t{0}).Number(min, max), json.At(1).Number(min, max), json.At(2).Number(min, max)};
}

// Angles about x, y and z, in this order [radians].
Eigen::Matrix3d FromRollPitchYaw(const Eigen::Vector3d& angles) {
  return (Eigen::AngleAxisd(angles.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(angles.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Vector3d ToRollPitchYaw(const Eigen::Matrix3d& r) {
  return {
      std::atan2(r(2, 1), r(2, 2)), std::asin(std::clamp(-r(2, 0), -1.0, 1.0)), std::atan2(r(1, 0), r(0, 0))};
}

Crop CropFromJson(const io::JsonReader& json) {
  Crop crop;
  crop.box.world_from_box.translation =
      ReadVector(json.At("crop_center"), -io::kMaxCoordinate, io::kMaxCoordinate);
  crop.box.size = ReadVector(json.At("crop_scale"), kMinCropSide, io::kMaxCoordinate);
  if (json.Has("crop_rot"))
    crop.box.world_from_box.rotation =
        FromRollPitchYaw(ReadVector(json.At("crop_rot"), -2 * std::numbers::pi, 2 * std::numbers::pi));
  const io::JsonReader colour = json.At("crop_bg_color");
  const char* channels[] = {"r", "g", "b"};
  for (std::size_t c = 0; c < 3; ++c)
    crop.background[c] = static_cast<float>(colour.At(channels[c]).Number(0, 255) / 255);
  return crop;
}

std::optional<Crop> ReadOptionalCrop(const io::JsonReader& file) {
  if (!file.Has("crop") || file.At("crop").IsNull()) return std::nullopt;
  return CropFromJson(file.At("crop"));
}

Json CropJson(const std::optional<Crop>& crop) {
  if (!crop) return nullptr;
  const auto list = [](const Eigen::Vector3d& v) { return Json({v.x(), v.y(), v.z()}); };
  const auto byte = [&](std::size_t c) { return std::lround(255 * crop->background[c]); };
  return {{"crop_center", list(crop->box.world_from_box.translation)},
          {"crop_scale", list(crop->box.size)},
          {"crop_rot", list(ToRollPitchYaw(crop->box.world_from_box.rotation))},
          {"crop_bg_color", {{"r", byte(0)}, {"g", byte(1)}, {"b", byte(2)}}}};
}

CameraPathFile FromJson(const io::JsonReader& json) {
  CameraPathFile file;
  file.width = json.At("render_width").Integer(1, kMaxPathSide);
  file.height = json.At("render_height").Integer(1, kMaxPathSide);
  file.fps = json.At("fps").Number(1, 240);
  if (json.Has("is_cycle")) file.is_loop = json.At("is_cycle").Bool();
  if (json.Has("camera_type") && json.At("camera_type").String() != "perspective")
    json.At("camera_type").Fail("is not \"perspective\"", "Other cameras cannot be rendered");
  file.crop = ReadOptionalCrop(json);
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
  if (file.crop && n_keyframes == 0 && (!json.Has("camera_path") || json.At("camera_path").Size() == 0))
    return file;
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
  CameraPathFile file = FromJson(io::JsonReader::ReadDocument(path));
  if (file.frames.empty())
    throw io::Error(io::ExitCode::kBadInput,
                    path.string() + ": has a crop box and no frames",
                    "Give it with --crop, or add views to it");
  return file;
}

CameraPathFile ParseCameraPath(const std::string& text, const std::string& name) {
  return FromJson(io::JsonReader::ParseDocument(text, name));
}

Crop ReadCrop(const std::filesystem::path& path) {
  const io::JsonReader json = io::JsonReader::ReadDocument(path);
  if (const std::optional<Crop> crop = ReadOptionalCrop(json)) return *crop;
  json.Fail("has no crop box", "Set one in `pipeline view` and save it");
}

Crop ParseCrop(const std::string& text, const std::string& name) {
  return CropFromJson(io::JsonReader::ParseDocument(text, name));
}

void WriteCameraPath(const std::filesystem::path& path, const CameraPathFile& file) {
  const double aspect = static_cast<double>(file.width) / file.height;
  const double default_fov = file.frames.empty() ? kDefaultFov : file.frames.front().fov_y / kDegree;
  Json json = {{"camera_type", "perspective"},
               {"default_fov", default_fov},
               {"render_height", file.height},
               {"render_width", file.width},
               {"fps", file.fps},
               {"seconds", static_cast<double>(file.frames.size()) / file.fps},
               {"smoothness_value", 0.5},
               {"is_cycle", file.is_loop},
               {"crop", CropJson(file.crop)},
               {"keyframes", Json::array()},
               {"camera_path", Json::array()}};
  const auto add = [&](const char* list, const char* matrix_key, const nerf::Keyframe& view) {
    json[list].push_back(
        {{matrix_key, RowsOf(view.world_from_cam)}, {"fov", view.fov_y / kDegree}, {"aspect", aspect}});
  };
  for (const nerf::Keyframe& view : file.keyframes) add("keyframes", "matrix", view);
  for (const nerf::Keyframe& view : file.frames) add("camera_path", "camera_to_world", view);
  io::WriteFileAtomically(path, io::DumpJson(json, 1) + "\n");
}

}  // namespace pipeline
