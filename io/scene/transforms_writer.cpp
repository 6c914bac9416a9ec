// Writes the transforms.json that every known reader accepts: extension in file_path, camera_model,
// intrinsics either all on top or all in every frame, zero distortion spelt out, identity applied_transform,
// and only pictures that exist.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/check.h"
#include "io/base/json.h"
#include "io/scene/transforms.h"

namespace io {
namespace {

namespace fs = std::filesystem;

// nlohmann-json writes NaN and infinity as null without a word.
double Finite(double value) {
  PIPELINE_CHECK(std::isfinite(value));
  return value;
}

Json ToJson(const Eigen::Vector3d& v) { return {Finite(v.x()), Finite(v.y()), Finite(v.z())}; }

Json ToJson(const Eigen::Matrix3d& m) {
  return {ToJson(Eigen::Vector3d(m.row(0))),
          ToJson(Eigen::Vector3d(m.row(1))),
          ToJson(Eigen::Vector3d(m.row(2)))};
}

Json MatrixJson(const Rigid3d& pose) {
  Json rows = ToJson(pose.rotation);
  for (int r = 0; r < 3; ++r) rows[static_cast<std::size_t>(r)].push_back(Finite(pose.translation[r]));
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

// Radians.
double AngleOfView(int pixels, double focal) { return 2.0 * std::atan(0.5 * pixels / focal); }

void AddIntrinsics(const Camera& camera, Json* json) {
  PIPELINE_CHECK(camera.width > 0 && camera.height > 0 && camera.fl_x > 0 && camera.fl_y > 0);
  (*json)["w"] = camera.width;
  (*json)["h"] = camera.height;
  (*json)["fl_x"] = Finite(camera.fl_x);
  (*json)["fl_y"] = Finite(camera.fl_y);
  (*json)["cx"] = Finite(camera.cx);
  (*json)["cy"] = Finite(camera.cy);
  (*json)["k1"] = Finite(camera.k1);
  (*json)["k2"] = Finite(camera.k2);
  (*json)["p1"] = Finite(camera.p1);
  (*json)["p2"] = Finite(camera.p2);
  (*json)["camera_angle_x"] = AngleOfView(camera.width, camera.fl_x);
  (*json)["camera_angle_y"] = AngleOfView(camera.height, camera.fl_y);
}

// One place for the path rule: relative to the file, with '/', never leaving its folder.
std::string RelativePath(const fs::path& json_path, const fs::path& image_path) {
  const fs::path relative = image_path.is_absolute()
                                ? image_path.lexically_normal().lexically_relative(
                                      fs::absolute(json_path).lexically_normal().parent_path())
                                : image_path.lexically_normal();
  if (relative.empty() || *relative.begin() == "..") {
    throw Error(ExitCode::kInternal,
                image_path.string() + ": does not lie below " + json_path.parent_path().string(),
                "Please report this as a bug");
  }
  return relative.generic_string();
}

// Ours alone, under one key: instant-ngp gives `aabb`, `scale` and `offset` on the top level another meaning.
Json PipelineJson(const Scene& scene) {
  return {{"near", Finite(scene.near)},
          {"far", Finite(scene.far)},
          {"aabb", {ToJson(scene.aabb.min), ToJson(scene.aabb.max)}},
          {"unbounded", scene.unbounded},
          {"scene_from_sfm",
           {{"scale", Finite(scene.scene_from_sfm.scale)},
            {"rotation", ToJson(scene.scene_from_sfm.rotation)},
            {"translation", ToJson(scene.scene_from_sfm.translation)}}}};
}

const Camera& CameraOf(const Scene& scene, const Frame& frame) {
  PIPELINE_CHECK(frame.camera_index >= 0 &&
                 static_cast<std::size_t>(frame.camera_index) < scene.cameras.size());
  return scene.cameras[static_cast<std::size_t>(frame.camera_index)];
}

// Whether one camera took all frames.
bool IsShared(const Scene& scene) {
  PIPELINE_CHECK(!scene.frames.empty());
  const Camera& first = CameraOf(scene, scene.frames[0]);
  return std::all_of(scene.frames.begin(), scene.frames.end(), [&](const Frame& frame) {
    return CameraOf(scene, frame) == first;
  });
}

// Whether the horizontal angle of view says all of a camera.
bool IsStatedByAngle(const Camera& camera) {
  return camera.fl_x == camera.fl_y && 2 * camera.cx == camera.width && 2 * camera.cy == camera.height &&
         !camera.HasDistortion();
}

void WriteJson(const fs::path& json_path, const Json& json) {
  std::string text;
  try {
    text = json.dump(1);
  } catch (const Json::type_error&) {
    throw Error(ExitCode::kBadInput, json_path.string() + ": a picture's name is not UTF-8", "Rename it");
  }
  WriteFileAtomically(json_path, text + "\n");
}

}  // namespace

void WriteTransforms(const fs::path& json_path, const Scene& scene, const std::string& ply_name) {
  const bool is_shared = IsShared(scene);
  Json json = Json::object();
  json["camera_model"] = "OPENCV";
  if (is_shared) AddIntrinsics(CameraOf(scene, scene.frames[0]), &json);
  if (!ply_name.empty()) json["ply_file_path"] = ply_name;
  json["applied_transform"] = {{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}};
  if ((scene.aabb.min.array() < scene.aabb.max.array()).all()) json["pipeline"] = PipelineJson(scene);
  Json& frames = json["frames"] = Json::array();
  for (const Frame& frame : scene.frames) {
    Json entry = Json::object();
    entry["file_path"] = RelativePath(json_path, frame.image_path);
    if (!frame.mask_path.empty()) entry["mask_path"] = RelativePath(json_path, frame.mask_path);
    if (!is_shared) AddIntrinsics(CameraOf(scene, frame), &entry);
    entry["transform_matrix"] = MatrixJson(frame.world_from_cam);
    frames.push_back(std::move(entry));
  }
  WriteJson(json_path, json);
}

void WriteBlenderTransforms(const fs::path& json_path, const Scene& scene) {
  const bool is_shared = IsShared(scene);
  Json json = Json::object();
  if (is_shared) {
    const Camera& camera = CameraOf(scene, scene.frames[0]);
    if (IsStatedByAngle(camera))
      json["camera_angle_x"] = AngleOfView(camera.width, camera.fl_x);
    else
      AddIntrinsics(camera, &json);
  }
  Json& frames = json["frames"] = Json::array();
  for (const Frame& frame : scene.frames) {
    PIPELINE_CHECK(frame.image_path.extension() == ".png");
    Json entry = Json::object();
    entry["file_path"] = "./" + RelativePath(json_path, fs::path(frame.image_path).replace_extension());
    if (!is_shared) AddIntrinsics(CameraOf(scene, frame), &entry);
    entry["transform_matrix"] = MatrixJson(frame.world_from_cam);
    frames.push_back(std::move(entry));
  }
  WriteJson(json_path, json);
}

}  // namespace io
