#include "pipeline/export/ply_table.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "io/base/atomic_file.h"
#include "pipeline/export/export_place.h"

namespace pipeline {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY bytes are copied as they lie in memory");

const char* NameOf(PlyType type) {
  return type == PlyType::kFloat ? "float" : type == PlyType::kUchar ? "uchar" : "ushort";
}

template <typename Value>
void Append(Value value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <typename Whole>
Whole Rounded(double value) {
  return static_cast<Whole>(std::lround(std::clamp<double>(value, 0, std::numeric_limits<Whole>::max())));
}

}  // namespace

void AddVectorColumns(const std::string& prefix,
                      const std::function<Eigen::Vector3d(std::size_t vertex)>& value,
                      std::vector<PlyColumn>* columns) {
  for (const int axis : {0, 1, 2})
    columns->push_back(
        {prefix + "xyz"[axis], PlyType::kFloat, [=](std::size_t i) { return value(i)[axis]; }});
}

void WritePlyTable(const std::filesystem::path& file,
                   const TargetFrame& target,
                   std::size_t n_vertices,
                   const std::vector<PlyColumn>& columns) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\n" + std::string(kExportComment) +
                      "comment frame " + target.name + ", unit: " + target.unit + "\nelement vertex " +
                      std::to_string(n_vertices) + "\n";
  for (const PlyColumn& column : columns)
    bytes += std::string("property ") + NameOf(column.type) + " " + column.name + "\n";
  bytes += "end_header\n";
  for (std::size_t i = 0; i < n_vertices; ++i) {
    for (const PlyColumn& column : columns) {
      const double value = column.value(i);
      if (column.type == PlyType::kFloat) Append(static_cast<float>(value), &bytes);
      if (column.type == PlyType::kUchar) Append(Rounded<std::uint8_t>(value), &bytes);
      if (column.type == PlyType::kUshort) Append(Rounded<std::uint16_t>(value), &bytes);
    }
  }
  io::WriteFileAtomically(file, bytes);
}

}  // namespace pipeline
