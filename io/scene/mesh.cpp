#include "io/scene/mesh.h"

#include "io/base/check.h"

namespace io {

Mesh TransformedMesh(const Sim3d& target_from_source, Mesh mesh) {
  for (Eigen::Vector3f& position : mesh.positions)
    position = (target_from_source * position.cast<double>()).cast<float>();
  const Eigen::Matrix3f rotation = target_from_source.rotation.cast<float>();
  for (Eigen::Vector3f& normal : mesh.normals) normal = rotation * normal;
  return mesh;
}

void CheckMesh(const Mesh& mesh) {
  const std::size_t n = mesh.positions.size();
  PIPELINE_CHECK_EQ(mesh.normals.size(), n);
  PIPELINE_CHECK_EQ(mesh.colours.size(), n);
  for (const Eigen::Vector3f& position : mesh.positions) PIPELINE_CHECK(position.allFinite());
  for (const Eigen::Vector3f& normal : mesh.normals) PIPELINE_CHECK(normal.allFinite());
  for (const std::array<std::uint32_t, 3>& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) PIPELINE_CHECK_LT(vertex, n);
  }
}

}  // namespace io
