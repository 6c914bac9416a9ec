// Meshes as PLY.
#include <fmt/format.h>

#include <bit>

#include "io/base/atomic_file.h"
#include "io/scene/mesh.h"

namespace io {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY bytes are copied as they lie in memory");

constexpr std::size_t kBytesPerVertex = 6 * sizeof(float) + 3,
                      kBytesPerTriangle = 1 + 3 * sizeof(std::int32_t);

template <typename T>
void Append(const T* values, std::size_t n, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(values), n * sizeof(T));
}

}  // namespace

void WriteMeshPly(const std::filesystem::path& path, const Mesh& mesh, const std::string& remark) {
  CheckMesh(mesh);
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment {}\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      remark,
      mesh.positions.size(),
      mesh.triangles.size());
  bytes.reserve(bytes.size() + kBytesPerVertex * mesh.positions.size() +
                kBytesPerTriangle * mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    Append(mesh.positions[i].data(), 3, &bytes);
    Append(mesh.normals[i].data(), 3, &bytes);
    Append(mesh.colours[i].data(), 3, &bytes);
  }
  for (const std::array<std::uint32_t, 3>& triangle : mesh.triangles) {
    bytes.push_back(3);
    Append(triangle.data(), 3, &bytes);
  }
  WriteFileAtomically(path, bytes);
}

}  // namespace io
