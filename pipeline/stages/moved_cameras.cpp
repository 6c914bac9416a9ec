#include "pipeline/stages/moved_cameras.h"

#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/json.h"

namespace pipeline {

void WriteMovedCameras(const std::filesystem::path& path, const std::vector<nerf::MovedCamera>& cameras) {
  io::Json frames = io::Json::array();
  for (const nerf::MovedCamera& camera : cameras) {
    const Eigen::Matrix3d& r = camera.world_from_cam.rotation;
    const Eigen::Vector3d& t = camera.world_from_cam.translation;
    io::Json rows = io::Json::array();
    for (int i = 0; i < 3; ++i) rows.push_back({r(i, 0), r(i, 1), r(i, 2), t[i]});
    rows.push_back({0, 0, 0, 1});
    frames.push_back({{"name", camera.name}, {"moved_px", camera.motion_px}, {"transform_matrix", rows}});
  }
  io::WriteFileAtomically(path, io::DumpJson(io::Json{{"frames", frames}}, 1) + "\n");
}

}  // namespace pipeline
