#include "pipeline/film/scene_json.h"

#include <nlohmann/json.hpp>

#include "io/base/json.h"
#include "nerf/data/capture_geometry.h"
#include "pipeline/film/camera_path_file.h"

namespace pipeline {
namespace {

using io::Json;

Json VectorJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

Json SceneJson(const io::Scene& scene, const std::string& run_name) {
  const nerf::CaptureGeometry capture = nerf::MeasureCapture(scene);
  Json json = {{"name", run_name},
               {"focus", VectorJson(capture.focus)},
               {"up", VectorJson(capture.up)},
               {"depth", capture.depth},
               {"cameras", Json::array()}};
  for (const io::Frame& frame : scene.frames) {
    const io::Camera& camera = scene.cameras.at(static_cast<std::size_t>(frame.camera_index));
    json["cameras"].push_back({{"name", frame.image_path.filename().string()},
                               {"pose", RowsOf(frame.world_from_cam)},
                               {"width", camera.width},
                               {"height", camera.height},
                               {"focal", camera.fl_y},
                               {"cx", camera.cx},
                               {"cy", camera.cy}});
  }
  return json;
}

}  // namespace pipeline
