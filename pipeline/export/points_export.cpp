#include "pipeline/export/points_export.h"

#include "pipeline/export/ply_table.h"

namespace pipeline {

void ExportPoints(const std::vector<Surfel>& surfels,
                  const TargetFrame& target,
                  const std::filesystem::path& file) {
  const io::Sim3d& target_from_scene = target.target_from_scene;
  std::vector<PlyColumn> columns;
  AddVectorColumns(
      "", [&](std::size_t i) { return target_from_scene * surfels[i].position; }, &columns);
  AddVectorColumns(
      "n", [&](std::size_t i) { return target_from_scene.rotation * surfels[i].normal; }, &columns);
  constexpr const char* kChannels[] = {"red", "green", "blue"};
  for (const int c : {0, 1, 2})
    columns.push_back(
        {kChannels[c], PlyType::kUchar, [&, c](std::size_t i) { return 255 * surfels[i].rgb[c]; }});
  columns.push_back({"support", PlyType::kUshort, [&](std::size_t i) { return surfels[i].support; }});
  WritePlyTable(file, target, surfels.size(), columns);
}

}  // namespace pipeline
