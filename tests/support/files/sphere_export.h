// Support for tests: a run whose field is the unit sphere of tests/support/scenes/sphere_field.h, ready to be
// exported, and files of exports read back without any code of ours.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "io/image/image.h"
#include "pipeline/export/exported_scene.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/sphere_field.h"

namespace tests {

// Pictures lie in <folder>/images; every fifth view is a test view. Sparse points lie on the sphere.
inline pipeline::ExportedScene SphereExport(const std::filesystem::path& folder,
                                            const pipeline::FrameOptions& frame = {},
                                            int n_views = 20) {
  pipeline::ExportedScene exported;
  exported.folder = folder;
  const SphereField field;
  const io::Scene all = RingScene(
      n_views, 96, 72, [&](int i) { return folder / "images" / ("view " + std::to_string(i) + ".png"); });
  for (io::Scene* part : {&exported.train, &exported.test}) {
    *part = all;
    part->frames.clear();
    part->scene_from_sfm = {
        0.4, Eigen::AngleAxisd(1, Eigen::Vector3d(1, 2, 2) / 3).toRotationMatrix(), {1, 2, 3}};
  }
  for (std::size_t i = 0; i < all.frames.size(); ++i) {
    io::WriteImage(all.frames[i].image_path, io::MakeImage(96, 72, 3));
    (i % 5 == 4 ? exported.test : exported.train).frames.push_back(all.frames[i]);
  }
  for (int i = 0; i < 30; ++i) {
    const double a = 0.7 * i, z = 0.6 * std::sin(i);
    exported.train.points.push_back(
        {.xyz = {std::sqrt(1 - z * z) * std::cos(a), std::sqrt(1 - z * z) * std::sin(a), z},
         .rgb = {10, 20, static_cast<std::uint8_t>(i)},
         .frame_indices = {i % 3, 7}});
  }
  exported.target = pipeline::MakeTargetFrame(frame, exported.train.scene_from_sfm);
  exported.field = std::make_unique<SphereField>();
  exported.support = std::make_unique<nerf::SupportMap>(field, exported.train, 2);
  exported.threads = 2;
  return exported;
}

// The columns of the vertices of a binary PLY by name, as its header lays them out.
inline std::map<std::string, std::vector<double>> PlyColumns(const std::filesystem::path& path) {
  const std::string bytes = ReadText(path);
  const std::size_t end = bytes.find("end_header\n") + std::strlen("end_header\n");
  std::istringstream lines(bytes.substr(0, end));
  std::vector<std::pair<std::string, std::string>> properties;  // type, name
  std::size_t n = 0, row = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string keyword, type, name;
    words >> keyword >> type >> name;
    if (keyword == "element") n = std::stoul(name);
    if (keyword != "property") continue;
    properties.push_back({type, name});
    row += type == "float" ? 4u : type == "ushort" ? 2u : 1u;
  }
  EXPECT_EQ(bytes.size(), end + n * row);
  std::map<std::string, std::vector<double>> columns;
  const char* at = bytes.data() + end;
  const auto take = [&]<typename Value>(Value value) {
    std::memcpy(&value, at, sizeof value);
    at += sizeof value;
    return static_cast<double>(value);
  };
  for (std::size_t i = 0; i < n; ++i) {
    for (const auto& [type, name] : properties)
      columns[name].push_back(type == "float"    ? take(float())
                              : type == "ushort" ? take(std::uint16_t())
                                                 : take(std::uint8_t()));
  }
  return columns;
}

}  // namespace tests
