// Sparse points as binary little-endian PLY: float x, y, z; uchar red, green, blue. Where it is known which
// frames observe the points, a second element lists it, which other readers skip: int vertex, frame.
#pragma once

#include <filesystem>
#include <vector>

#include "io/scene/scene.h"

namespace io {

// Observers are whatever the file says: the caller knows how many frames there are.
std::vector<Point3D> ReadPly(const std::filesystem::path& path);
void WritePly(const std::filesystem::path& path, const std::vector<Point3D>& points);

}  // namespace io
