#include "pipeline/export/mesh_export.h"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/base/error.h"
#include "io/process/progress.h"
#include "io/scene/mesh.h"
#include "nerf/surface/surface.h"
#include "pipeline/export/export_place.h"

namespace pipeline {
namespace {

// The smallest box along the scene's axes that holds the crop box.
io::Aabb BoundsOf(const nerf::CropBox& crop) {
  const Eigen::Vector3d reach = 0.5 * crop.world_from_box.rotation.cwiseAbs() * crop.size;
  return {crop.world_from_box.translation - reach, crop.world_from_box.translation + reach};
}

void RemoveOutside(const nerf::CropBox& crop, io::Mesh* mesh) {
  std::erase_if(mesh->triangles, [&](const auto& corners) {
    return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
      return !nerf::Contains(crop, mesh->positions[corner].cast<double>());
    });
  });
  // Corners of the triangles that stay, in their order.
  constexpr std::uint32_t kUnused = UINT32_MAX;
  std::vector<std::uint32_t> place(mesh->positions.size(), kUnused);
  io::Mesh kept;
  for (auto& corners : mesh->triangles) {
    for (std::uint32_t& corner : corners) {
      if (place[corner] == kUnused) {
        place[corner] = static_cast<std::uint32_t>(kept.positions.size());
        kept.positions.push_back(mesh->positions[corner]);
        kept.normals.push_back(mesh->normals[corner]);
        kept.colours.push_back(mesh->colours[corner]);
      }
      corner = place[corner];
    }
  }
  kept.triangles = std::move(mesh->triangles);
  *mesh = std::move(kept);
}

}  // namespace

std::size_t ExportMesh(const ExportedScene& scene, int max_triangles, const std::filesystem::path& file) {
  nerf::SurfaceOptions options{.threads = scene.threads,
                               .triangles = static_cast<std::size_t>(max_triangles)};
  if (scene.crop) options.box = BoundsOf(*scene.crop);
  std::optional<io::Progress> bar;
  std::string shown;
  options.progress = [&](const char* what, double share) {
    if (shown != what) bar.emplace(shown = what);
    bar->Update(share);
  };
  nerf::Surface surface = nerf::ExtractSurface(*scene.field, scene.train, options);
  bar.reset();
  if (scene.crop) RemoveOutside(*scene.crop, &surface.mesh);
  if (surface.mesh.triangles.empty())
    throw io::Error(io::ExitCode::kBadInput, "no surface lies in the crop box", "Move the box");
  for (const std::string& line : surface.Decisions()) std::printf("mesh    %s\n", line.c_str());
  const io::Mesh mesh = io::TransformedMesh(scene.target.target_from_scene, std::move(surface.mesh));
  const std::string remark =
      std::string(kExportMark) + ", frame " + scene.target.name + ", unit: " + scene.target.unit;
  file.extension() == ".glb" ? io::WriteMeshGlb(file, mesh, remark) : io::WriteMeshPly(file, mesh, remark);
  return mesh.triangles.size();
}

}  // namespace pipeline
