#include "nerf/surface/mesh_repair.h"

#include <meshoptimizer.h>

#include <limits>
#include <numeric>

namespace nerf {
namespace {

using Eigen::Vector3f;
using Triangle = std::array<std::uint32_t, 3>;

// Twice the area of the triangle, along its normal.
Vector3f AreaNormal(const io::Mesh& mesh, const Triangle& triangle) {
  const Vector3f& a = mesh.positions[triangle[0]];
  return (mesh.positions[triangle[1]] - a).cross(mesh.positions[triangle[2]] - a);
}

// The vertex that stands for the piece of `vertex`; paths are halved on the way.
std::uint32_t PieceOf(std::uint32_t vertex, std::vector<std::uint32_t>* parent) {
  while ((*parent)[vertex] != vertex) vertex = (*parent)[vertex] = (*parent)[(*parent)[vertex]];
  return vertex;
}

template <typename T>
void Compact(const std::vector<std::uint8_t>& used, std::vector<T>* values) {
  std::size_t n = 0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i]) (*values)[n++] = (*values)[i];
  }
  values->resize(n);
}

}  // namespace

std::vector<Vector3f> VertexNormals(const io::Mesh& mesh) {
  std::vector<Vector3f> normals(mesh.positions.size(), Vector3f::Zero());
  for (const Triangle& triangle : mesh.triangles) {
    const Vector3f normal = AreaNormal(mesh, triangle);
    for (const std::uint32_t vertex : triangle) normals[vertex] += normal;
  }
  for (Vector3f& normal : normals) {
    const float length = normal.norm();
    normal = length > 0 ? Vector3f(normal / length) : Vector3f(Vector3f::UnitZ());
  }
  return normals;
}

double Area(const io::Mesh& mesh) {
  double area = 0;
  for (const Triangle& triangle : mesh.triangles)
    area += 0.5 * static_cast<double>(AreaNormal(mesh, triangle).norm());
  return area;
}

void KeepVertices(const std::vector<std::uint8_t>& keep, io::Mesh* mesh) {
  std::erase_if(mesh->triangles, [&](const Triangle& triangle) {
    return !(keep[triangle[0]] && keep[triangle[1]] && keep[triangle[2]]);
  });
  DropUnusedVertices(mesh);
}

int DropSmallPieces(double least_share, io::Mesh* mesh) {
  std::vector<std::uint32_t> parent(mesh->positions.size());
  std::iota(parent.begin(), parent.end(), 0u);
  for (const Triangle& triangle : mesh->triangles) {
    const std::uint32_t root = PieceOf(triangle[0], &parent);
    parent[PieceOf(triangle[1], &parent)] = root;
    parent[PieceOf(triangle[2], &parent)] = root;
  }
  std::vector<double> area(parent.size(), 0);
  double total = 0;
  for (const Triangle& triangle : mesh->triangles) {
    const double own = 0.5 * static_cast<double>(AreaNormal(*mesh, triangle).norm());
    area[PieceOf(triangle[0], &parent)] += own;
    total += own;
  }
  std::vector<std::uint8_t> keep(parent.size());
  std::vector<std::uint8_t> is_dropped(parent.size(), 0);
  for (std::uint32_t i = 0; i < parent.size(); ++i) {
    const std::uint32_t piece = PieceOf(i, &parent);
    keep[i] = area[piece] >= least_share * total;
    is_dropped[piece] = !keep[i] && area[piece] > 0;
  }
  KeepVertices(keep, mesh);
  return static_cast<int>(std::accumulate(is_dropped.begin(), is_dropped.end(), 0));
}

void Decimate(std::size_t triangles, io::Mesh* mesh) {
  if (mesh->triangles.size() <= triangles) return;
  std::vector<Triangle> reduced(mesh->triangles.size());
  const std::size_t n = meshopt_simplify(reduced[0].data(),
                                         mesh->triangles[0].data(),
                                         3 * mesh->triangles.size(),
                                         mesh->positions[0].data(),
                                         mesh->positions.size(),
                                         sizeof(Vector3f),
                                         3 * triangles,
                                         std::numeric_limits<float>::max(),
                                         0,
                                         nullptr);
  reduced.resize(n / 3);
  mesh->triangles = std::move(reduced);
  DropUnusedVertices(mesh);
}

void DropUnusedVertices(io::Mesh* mesh) {
  std::vector<std::uint8_t> used(mesh->positions.size(), 0);
  for (const Triangle& triangle : mesh->triangles) {
    for (const std::uint32_t vertex : triangle) used[vertex] = 1;
  }
  std::vector<std::uint32_t> index(used.size());
  std::uint32_t n = 0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    index[i] = n;
    n += used[i];
  }
  for (Triangle& triangle : mesh->triangles) {
    for (std::uint32_t& vertex : triangle) vertex = index[vertex];
  }
  Compact(used, &mesh->positions);
  Compact(used, &mesh->normals);
  Compact(used, &mesh->colours);
}

}  // namespace nerf
