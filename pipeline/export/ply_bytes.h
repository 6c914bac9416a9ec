// The bytes of a binary little-endian PLY file whose only element are its vertices.
#pragma once

#include <bit>
#include <initializer_list>
#include <string>

#include "pipeline/export/export_place.h"

namespace pipeline {

static_assert(std::endian::native == std::endian::little, "PLY bytes are copied as they lie in memory");

// properties: type and name, "float x". remark: a line that says what the numbers mean.
inline std::string PlyHeader(std::size_t n_vertices,
                             const std::string& remark,
                             std::initializer_list<const char*> properties) {
  std::string header = "ply\nformat binary_little_endian 1.0\n" + std::string(kExportComment) + "comment " +
                       remark + "\nelement vertex " + std::to_string(n_vertices) + "\n";
  for (const char* property : properties) header += std::string("property ") + property + "\n";
  return header + "end_header\n";
}

template <typename Value>
void AppendBytes(const Value& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace pipeline
