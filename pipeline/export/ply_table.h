// Binary little-endian PLY files whose only element are their vertices.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/export/target_frame.h"

namespace pipeline {

enum class PlyType { kFloat, kUchar, kUshort };

// A property of the vertices. Whole numbers are rounded and kept within their type.
struct PlyColumn {
  std::string name;
  PlyType type;
  std::function<double(std::size_t vertex)> value;
};

// "x", "y", "z", or with a prefix "nx": the parts of a vector.
void AddVectorColumns(const std::string& prefix,
                      const std::function<Eigen::Vector3d(std::size_t vertex)>& value,
                      std::vector<PlyColumn>* columns);

// The head says who wrote the file, and the frame and unit of its lengths. Throws kNoResources.
void WritePlyTable(const std::filesystem::path& file,
                   const TargetFrame& target,
                   std::size_t n_vertices,
                   const std::vector<PlyColumn>& columns);

}  // namespace pipeline
