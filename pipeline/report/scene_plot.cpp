// The scene as numbers for the report's rotatable plot.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "nerf/rendering/camera_path.h"
#include "pipeline/report/report_data.h"

namespace pipeline {
namespace {

using Json = nlohmann::ordered_json;
using Eigen::Vector3d;
namespace fs = std::filesystem;

// More points than this cost file size and drawing time, and show no more.
constexpr std::size_t kMaxPoints = 8000;
constexpr int kPathPoses = 90;
// Points further away than this many orbit distances would shrink the rest to a dot.
constexpr double kMaxReach = 2.5;
// Length of a drawn camera in orbit distances.
constexpr double kCameraLength = 0.08;

// Three decimals of the orbit distance are below a pixel of the plot.
Json Rounded(double v) { return std::round(1000 * v) / 1000; }

void Append(const Vector3d& p, Json* array) {
  for (const double v : {p.x(), p.y(), p.z()}) array->push_back(Rounded(v));
}

}  // namespace

std::string ScenePlotJson(const fs::path& run_folder) {
  const fs::path train_file = run_folder / "scene" / "transforms_train.json";
  const fs::path test_file = run_folder / "scene" / "transforms_test.json";
  const fs::path points_file = run_folder / "scene" / "points.ply";
  if (!fs::is_regular_file(train_file)) return "";
  const io::Scene train = io::ReadTransforms(train_file).scene;
  const nerf::CameraPath path = nerf::FitOrbit(train, kPathPoses);

  Eigen::Matrix3d axes;  // columns: the plot's x, y, z in the world
  const Vector3d x = path.up.unitOrthogonal();
  axes << x, path.up.cross(x), path.up;
  const auto to_plot = [&](const Vector3d& p) -> Vector3d {
    return axes.transpose() * (p - path.focus) / path.distance;
  };

  Json json;
  const auto add_cameras = [&](const io::Scene& scene, const char* name) {
    json[name] = Json::array();
    for (const io::Frame& frame : scene.frames) {
      const io::Camera& camera = scene.cameras[frame.camera_index];
      const double length = kCameraLength * path.distance;
      const double half_x = 0.5 * length * camera.width / camera.fl_x;
      const double half_y = 0.5 * length * camera.height / camera.fl_y;
      Json outline = Json::array();
      Append(to_plot(frame.world_from_cam.translation), &outline);
      for (const auto& [sx, sy] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)}) {
        Append(to_plot(frame.world_from_cam * Vector3d(sx * half_x, sy * half_y, -length)), &outline);
      }
      json[name].push_back(outline);
    }
  };
  add_cameras(train, "train");
  if (fs::is_regular_file(test_file)) add_cameras(io::ReadTransforms(test_file).scene, "test");

  json["path"] = Json::array();
  for (const io::Rigid3d& pose : path.world_from_cam) Append(to_plot(pose.translation), &json["path"]);
  json["points"] = Json::array();
  if (fs::is_regular_file(points_file)) {
    const std::vector<io::Point3D> points = io::ReadPly(points_file);
    const std::size_t stride = std::max<std::size_t>(1, (points.size() + kMaxPoints - 1) / kMaxPoints);
    for (std::size_t i = 0; i < points.size(); i += stride) {
      const Vector3d p = to_plot(points[i].xyz);
      if (!(p.norm() < kMaxReach)) continue;
      Append(p, &json["points"]);
      for (const int v : points[i].rgb) json["points"].push_back(v);
    }
  }
  return json.dump();
}

}  // namespace pipeline
