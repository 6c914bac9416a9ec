// Sparse points as binary little-endian PLY: float x, y, z; uchar red, green, blue.
#pragma once

#include <filesystem>
#include <vector>

#include "io/scene/scene.h"

namespace io {

std::vector<Point3D> ReadPly(const std::filesystem::path& path);
void WritePly(const std::filesystem::path& path, const std::vector<Point3D>& points);

}  // namespace io
