// The field's surface as a triangle mesh.
#pragma once

#include <cstddef>
#include <filesystem>

#include "pipeline/export/exported_scene.h"

namespace pipeline {

// Writes .glb or .ply, by the file's name, and returns the number of triangles, at most `max_triangles`. With
// a crop box, triangles with a corner outside are left out. Throws kBadInput when no surface is left.
std::size_t ExportMesh(const ExportedScene& scene, int max_triangles, const std::filesystem::path& file);

}  // namespace pipeline
