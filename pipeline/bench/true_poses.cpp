#include "pipeline/bench/true_poses.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/natural_order.h"
#include "io/scene/transforms.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// Files give six digits.
constexpr double kRotationTolerance = 1e-4;
constexpr std::size_t kMaxCameraFileBytes = 1 << 16;

void ReadCameraFile(const fs::path& path, io::Scene* scene) {
  std::istringstream in(io::ReadFile(path, kMaxCameraFileBytes));
  double values[26];
  for (double& value : values) {
    if (!(in >> value) || !std::isfinite(value))
      throw io::Error(io::ExitCode::kBadInput, path.string() + ": does not begin with 26 numbers");
  }
  io::Rigid3d world_from_cam;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      world_from_cam.rotation(row, column) = values[12 + 3 * row + column];
    world_from_cam.translation[row] = values[21 + row];
  }
  const Eigen::Matrix3d& r = world_from_cam.rotation;
  if ((r * r.transpose() - Eigen::Matrix3d::Identity()).norm() > kRotationTolerance || r.determinant() < 0)
    throw io::Error(io::ExitCode::kBadInput, path.string() + ": lines 5 to 7 are no rotation");
  scene->frames.push_back({.image_path = path.stem(),
                           .camera_index = static_cast<int>(scene->cameras.size()),
                           .world_from_cam = io::FlipCameraAxes(world_from_cam)});
  scene->cameras.push_back({.width = static_cast<int>(values[24]),
                            .height = static_cast<int>(values[25]),
                            .fl_x = values[0],
                            .fl_y = values[4],
                            .cx = values[2],
                            .cy = values[5]});
}

}  // namespace

io::Scene ReadTruePoses(const fs::path& path) {
  if (!fs::is_directory(path)) {
    io::Scene scene = io::ReadTransforms(path).scene;
    for (io::Frame& frame : scene.frames) frame.image_path = frame.image_path.filename();
    return scene;
  }
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path)) {
    if (entry.path().extension() == ".camera") files.push_back(entry.path());
  }
  if (files.empty()) {
    throw io::Error(io::ExitCode::kBadInput,
                    path.string() + ": holds no *.camera files",
                    "Give such a folder or a transforms.json");
  }
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return io::NaturalLess(a.string(), b.string());
  });
  io::Scene scene;
  for (const fs::path& file : files) ReadCameraFile(file, &scene);
  return scene;
}

}  // namespace pipeline
