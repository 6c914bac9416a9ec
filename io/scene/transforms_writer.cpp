// Writes the transforms.json that every known reader accepts: extension in file_path, camera_model,
// intrinsics either all on top or all in every frame, zero distortion spelt out, identity applied_transform,
// and only pictures that exist.
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/check.h"
#include "io/scene/transforms.h"

namespace io {
namespace {

using Json = nlohmann::ordered_json;
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
  (*json)["camera_angle_x"] = 2.0 * std::atan(0.5 * camera.width / camera.fl_x);
  (*json)["camera_angle_y"] = 2.0 * std::atan(0.5 * camera.height / camera.fl_y);
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

}  // namespace

void WriteTransforms(const fs::path& json_path, const Scene& scene, const std::string& ply_name) {
  PIPELINE_CHECK(!scene.frames.empty());
  bool is_shared = true;
  for (const Frame& frame : scene.frames) {
    PIPELINE_CHECK(frame.camera_index >= 0 &&
                   static_cast<std::size_t>(frame.camera_index) < scene.cameras.size());
    is_shared = is_shared && scene.cameras[static_cast<std::size_t>(frame.camera_index)] ==
                                 scene.cameras[static_cast<std::size_t>(scene.frames[0].camera_index)];
  }

  Json json;
  json["camera_model"] = "OPENCV";
  if (is_shared) AddIntrinsics(scene.cameras[static_cast<std::size_t>(scene.frames[0].camera_index)], &json);
  if (!ply_name.empty()) json["ply_file_path"] = ply_name;
  json["applied_transform"] = {{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}};
  if ((scene.aabb.min.array() < scene.aabb.max.array()).all()) json["pipeline"] = PipelineJson(scene);
  Json& frames = json["frames"] = Json::array();
  for (const Frame& frame : scene.frames) {
    Json entry;
    entry["file_path"] = RelativePath(json_path, frame.image_path);
    if (!frame.mask_path.empty()) entry["mask_path"] = RelativePath(json_path, frame.mask_path);
    if (!is_shared) AddIntrinsics(scene.cameras[static_cast<std::size_t>(frame.camera_index)], &entry);
    entry["transform_matrix"] = MatrixJson(frame.world_from_cam);
    frames.push_back(std::move(entry));
  }
  std::string text;
  try {
    text = json.dump(1);
  } catch (const Json::type_error&) {
    throw Error(ExitCode::kBadInput, json_path.string() + ": a picture's name is not UTF-8", "Rename it");
  }
  WriteFileAtomically(json_path, text + "\n");
}

}  // namespace io
