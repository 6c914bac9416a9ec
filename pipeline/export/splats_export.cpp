#include "pipeline/export/splats_export.h"

#include <cmath>
#include <string>

#include "pipeline/export/ply_table.h"

namespace pipeline {
namespace {

// The factors k1, k2, k3 of a channel are those of a vector's product with the direction, which turns with
// the scene.
Eigen::Vector3d TurnedHarmonics(const Eigen::Matrix3d& rotation, double k1, double k2, double k3) {
  const Eigen::Vector3d turned = rotation * Eigen::Vector3d(-k3, -k1, k2);
  return {-turned.y(), turned.z(), -turned.x()};
}

}  // namespace

void WriteSplats(const nerf::Splats& splats, const TargetFrame& target, const std::filesystem::path& file) {
  const io::Sim3d& target_from_scene = target.target_from_scene;
  std::vector<PlyColumn> columns;
  const auto add = [&](const std::string& name, int index, auto value) {
    columns.push_back({name + std::to_string(index), PlyType::kFloat, value});
  };
  const auto colour = [&](std::size_t i, int k, int c) -> double {
    return splats
        .colours[(i * nerf::kHarmonics + static_cast<std::size_t>(k)) * 3 + static_cast<std::size_t>(c)];
  };
  AddVectorColumns(
      "",
      [&](std::size_t i) -> Eigen::Vector3d {
        return target_from_scene * Eigen::Vector3f(&splats.places[3 * i]).cast<double>();
      },
      &columns);
  AddVectorColumns(
      "n", [](std::size_t) -> Eigen::Vector3d { return Eigen::Vector3d::Zero(); }, &columns);
  for (const int c : {0, 1, 2}) add("f_dc_", c, [=](std::size_t i) { return colour(i, 0, c); });
  for (const int c : {0, 1, 2}) {
    for (const int k : {0, 1, 2})
      add("f_rest_", 3 * c + k, [&, colour, c, k](std::size_t i) {
        return TurnedHarmonics(
            target_from_scene.rotation, colour(i, 1, c), colour(i, 2, c), colour(i, 3, c))[k];
      });
  }
  columns.push_back({"opacity", PlyType::kFloat, [&](std::size_t i) { return splats.opacities[i]; }});
  for (const int axis : {0, 1, 2}) {
    add("scale_", axis, [&, axis](std::size_t i) {
      return static_cast<double>(splats.log_scales[3 * i + static_cast<std::size_t>(axis)]) +
             std::log(target_from_scene.scale);
    });
  }
  const Eigen::Quaterniond turn(target_from_scene.rotation);
  for (const int part : {0, 1, 2, 3}) {
    add("rot_", part, [&, part](std::size_t i) {
      const float* q = &splats.rotations[4 * i];
      const Eigen::Quaterniond turned = turn * Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
      return part == 0 ? turned.w() : turned.vec()[part - 1];
    });
  }
  WritePlyTable(file, target, splats.size(), columns);
}

}  // namespace pipeline
