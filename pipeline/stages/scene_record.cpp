#include "pipeline/stages/scene_record.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "io/base/json.h"
#include "io/base/json_reader.h"

namespace pipeline {
namespace {

using io::Json;
namespace fs = std::filesystem;

Json ToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json ToJson(const io::Sim3d& sim3) {
  Json rotation = Json::array();
  for (int r = 0; r < 3; ++r) rotation.push_back(ToJson(Eigen::Vector3d(sim3.rotation.row(r))));
  return {{"scale", sim3.scale}, {"rotation", rotation}, {"translation", ToJson(sim3.translation)}};
}

}  // namespace

void WriteSceneRecord(const SceneRecord& record,
                      const PoseSource& source,
                      const std::optional<sfm::NormalizeReport>& report,
                      StageRun* stage) {
  Json coverage, coverage_near, depth_range;  // null: unknown
  if (report && report->coverage) {
    coverage = *report->coverage;
    coverage_near = *report->coverage_near;
    depth_range = {report->depth_min, report->depth_max};
  }
  stage->SetJson("coverage", coverage);
  stage->SetJson("coverage_near", coverage_near);
  stage->SetJson("depth_range", depth_range);
  if (record.masks > 0) {
    stage->Set("masks", record.masks);
    stage->Set("used_share", record.used_share);
  }
  const io::Scene& scene = source.scene;
  stage->Set("near", scene.near);
  stage->Set("far", scene.far);
  stage->SetJson("aabb", {ToJson(scene.aabb.min), ToJson(scene.aabb.max)});
  stage->SetJson("unbounded", scene.unbounded);
  stage->SetJson("scene_from_sfm", ToJson(scene.scene_from_sfm));
  stage->Set("protocol", record.protocol);
  stage->Set("frames", static_cast<double>(scene.frames.size()));
  stage->Set("points", static_cast<double>(scene.points.size()));
  Json held_out = Json::array();
  for (std::size_t i = 0; i < source.splits.size(); ++i) {
    if (source.splits[i] == "test") held_out.push_back(scene.frames[i].image_path.filename().string());
  }
  stage->SetJson("held_out", held_out);
  stage->SetJson("missing_images", Json(source.missing_images));
}

SceneRecord ReadSceneRecord(const fs::path& run_folder) {
  const fs::path path = run_folder / "scene" / "scene.json";
  SceneRecord record;
  if (!fs::is_regular_file(path)) return record;
  const io::JsonReader json = io::JsonReader::ReadDocument(path);
  if (json.Has("protocol")) record.protocol = json.At("protocol").String();
  if (json.Has("masks")) record.masks = json.At("masks").Integer(0, std::numeric_limits<int>::max());
  if (json.Has("used_share")) record.used_share = json.At("used_share").Number(0, 1);
  return record;
}

}  // namespace pipeline
