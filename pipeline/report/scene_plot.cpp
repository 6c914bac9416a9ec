// The scene as numbers for the report's rotatable plot.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/base/json.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "nerf/paths/camera_path.h"
#include "pipeline/report/report_data.h"

namespace pipeline {
namespace {

using Eigen::Vector3d;
using io::Json;
namespace fs = std::filesystem;

// More points than this cost file size and drawing time, and show no more.
constexpr std::size_t kMaxPoints = 8000;
constexpr std::size_t kPathPoses = 90;
// Points further away than this many orbit distances would shrink the rest to a dot.
constexpr double kMaxReach = 2.5;
// Length of a drawn camera in orbit distances.
constexpr double kCameraLength = 0.08;

// Three decimals of the orbit distance are below a pixel of the plot.
Json Rounded(double v) { return std::round(1000 * v) / 1000; }

void Append(const Vector3d& p, Json* array) {
  for (const double v : {p.x(), p.y(), p.z()}) array->push_back(Rounded(v));
}

// The poses of the film; those that it would have where it is not rendered yet.
std::vector<io::Rigid3d> FilmPoses(const fs::path& run_folder, const nerf::CameraPath& fitted) {
  const fs::path written = run_folder / "render" / "camera_path.json";
  if (!fs::is_regular_file(written)) return fitted.world_from_cam;
  const std::vector<io::Rigid3d> all = nerf::PosesOf(io::ReadTransforms(written).scene);
  std::vector<io::Rigid3d> poses;
  const std::size_t n = std::min(all.size(), kPathPoses);
  for (std::size_t i = 0; i < n; ++i)
    poses.push_back(all[i * (all.size() - 1) / std::max<std::size_t>(1, n - 1)]);
  return poses;
}

}  // namespace

std::string ScenePlotJson(const fs::path& run_folder) {
  const fs::path train_file = run_folder / "scene" / "transforms_train.json";
  const fs::path test_file = run_folder / "scene" / "transforms_test.json";
  const fs::path points_file = run_folder / "scene" / "points.ply";
  if (!fs::is_regular_file(train_file)) return "";
  const io::Scene train = io::ReadTransforms(train_file).scene;
  const nerf::CameraPath path = nerf::FitCameraPath(train, kPathPoses);

  Eigen::Matrix3d axes;  // columns: the plot's x, y, z in the world
  const Vector3d x = path.capture.up.unitOrthogonal();
  axes << x, path.capture.up.cross(x), path.capture.up;
  const auto to_plot = [&](const Vector3d& p) -> Vector3d {
    return axes.transpose() * (p - path.capture.focus) / path.distance;
  };

  Json json = Json::object();
  const auto add_cameras = [&](const io::Scene& scene, const char* name) {
    json[name] = Json::array();
    for (const io::Frame& frame : scene.frames) {
      const io::Camera& camera = scene.cameras[static_cast<std::size_t>(frame.camera_index)];
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
  for (const io::Rigid3d& pose : FilmPoses(run_folder, path))
    Append(to_plot(pose.translation), &json["path"]);
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
  return io::DumpJson(json);
}

}  // namespace pipeline
