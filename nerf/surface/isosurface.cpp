#include "nerf/surface/isosurface.h"

#include <cmath>

#include "nerf/surface/mesh_repair.h"

namespace nerf {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using Eigen::Vector3i;

constexpr int kSide = SparseVolume::kSide, kCorners = kSide + 1;

// The samples of a block and the next ones of its neighbours, which the corners of its cells are.
using Corners = std::array<float, kCorners * kCorners * kCorners>;

std::size_t CornerIndex(int x, int y, int z) {
  return static_cast<std::size_t>((z * kCorners + y) * kCorners + x);
}

void Gather(const SparseVolume& volume, std::size_t block, Corners* corners) {
  const SparseVolume::Block* neighbours[8];
  for (int i = 0; i < 8; ++i) {
    const int found = volume.Find(volume.place(block) + Vector3i(i & 1, i >> 1 & 1, i >> 2));
    neighbours[i] = found < 0 ? nullptr : &volume.block(static_cast<std::size_t>(found));
  }
  for (int z = 0; z < kCorners; ++z) {
    for (int y = 0; y < kCorners; ++y) {
      for (int x = 0; x < kCorners; ++x) {
        const auto* from = neighbours[(x == kSide) + 2 * (y == kSide) + 4 * (z == kSide)];
        (*corners)[CornerIndex(x, y, z)] =
            from ? (*from)[SparseVolume::Index(x % kSide, y % kSide, z % kSide)] : SparseVolume::kUnknown;
      }
    }
  }
}

// Mean of the zeros on the edges of a cell, in cells from its first corner; false when there is none or a
// corner is unknown.
bool CellVertex(const Corners& corners, int x, int y, int z, Vector3f* vertex) {
  float value[8];
  int n_inside = 0;
  for (int i = 0; i < 8; ++i) {
    value[i] = corners[CornerIndex(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2))];
    if (std::isnan(value[i])) return false;
    n_inside += value[i] < 0;
  }
  if (n_inside == 0 || n_inside == 8) return false;
  Vector3f sum = Vector3f::Zero();
  int n = 0;
  for (int i = 0; i < 8; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const int j = i | 1 << axis;
      if (j == i || (value[i] < 0) == (value[j] < 0)) continue;
      Vector3f at(static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1), static_cast<float>(i >> 2));
      at[axis] = value[i] / (value[i] - value[j]);
      sum += at;
      ++n;
    }
  }
  *vertex = sum / static_cast<float>(n);
  return true;
}

// Vertices of the cells of one block, and the triangles of the edges that start at its samples.
struct BlockSurface {
  std::array<std::int16_t, SparseVolume::kSamples> vertex_of;  // of each cell, -1: none
  std::vector<Vector3f> vertices;
  std::uint32_t first_vertex = 0;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

void FindVertices(const SparseVolume& volume, std::size_t block, BlockSurface* surface) {
  Corners corners;
  Gather(volume, block, &corners);
  surface->vertex_of.fill(-1);
  for (int z = 0; z < kSide; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        Vector3f at;
        if (!CellVertex(corners, x, y, z, &at)) continue;
        surface->vertex_of[SparseVolume::Index(x, y, z)] =
            static_cast<std::int16_t>(surface->vertices.size());
        const Vector3d in_cells = Vector3d(x, y, z) + at.cast<double>();
        surface->vertices.push_back((volume.Corner(block) + volume.voxel() * in_cells).cast<float>());
      }
    }
  }
}

// The vertex of a cell given relative to the first one of a block, as far as the blocks before it; -1: none.
std::int64_t VertexOfCell(const SparseVolume& volume,
                          const std::vector<BlockSurface>& surfaces,
                          std::size_t block,
                          Vector3i cell) {
  Vector3i place = volume.place(block);
  for (int axis = 0; axis < 3; ++axis) {
    if (cell[axis] >= 0) continue;
    cell[axis] += kSide;
    --place[axis];
  }
  const int found = place == volume.place(block) ? static_cast<int>(block) : volume.Find(place);
  if (found < 0) return -1;
  const BlockSurface& surface = surfaces[static_cast<std::size_t>(found)];
  const int vertex = surface.vertex_of[SparseVolume::Index(cell.x(), cell.y(), cell.z())];
  return vertex < 0 ? -1 : static_cast<std::int64_t>(surface.first_vertex) + vertex;
}

void AddQuad(const SparseVolume& volume,
             const std::vector<BlockSurface>& surfaces,
             std::size_t block,
             const Vector3i& sample,
             int axis,
             bool inside_first,
             std::vector<std::array<std::uint32_t, 3>>* triangles) {
  const int b = (axis + 1) % 3, c = (axis + 2) % 3;
  std::array<std::uint32_t, 4> quad;
  for (std::size_t i = 0; i < 4; ++i) {  // around +axis, counter-clockwise
    Vector3i cell = sample;
    cell[b] -= i == 0 || i == 3;
    cell[c] -= i < 2;
    const std::int64_t vertex = VertexOfCell(volume, surfaces, block, cell);
    if (vertex < 0) return;
    quad[i] = static_cast<std::uint32_t>(vertex);
  }
  if (!inside_first) std::swap(quad[1], quad[3]);
  triangles->push_back({quad[0], quad[1], quad[2]});
  triangles->push_back({quad[0], quad[2], quad[3]});
}

void FindTriangles(const SparseVolume& volume,
                   const std::vector<BlockSurface>& surfaces,
                   std::size_t block,
                   std::vector<std::array<std::uint32_t, 3>>* triangles) {
  Corners corners;
  Gather(volume, block, &corners);
  for (int z = 0; z < kSide; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const float here = corners[CornerIndex(x, y, z)];
        for (int axis = 0; axis < 3; ++axis) {
          const float next = corners[CornerIndex(x + (axis == 0), y + (axis == 1), z + (axis == 2))];
          if (std::isnan(here) || std::isnan(next) || (here < 0) == (next < 0)) continue;
          AddQuad(volume, surfaces, block, {x, y, z}, axis, here < 0, triangles);
        }
      }
    }
  }
}

}  // namespace

io::Mesh ExtractIsosurface(const SparseVolume& volume, io::Workers* workers) {
  std::vector<BlockSurface> surfaces(volume.size());
  const int n_blocks = static_cast<int>(volume.size());
  workers->Run(n_blocks, [&](int i, int) {
    FindVertices(volume, static_cast<std::size_t>(i), &surfaces[static_cast<std::size_t>(i)]);
  });
  io::Mesh mesh;
  for (BlockSurface& surface : surfaces) {
    surface.first_vertex = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), surface.vertices.begin(), surface.vertices.end());
  }
  workers->Run(n_blocks, [&](int i, int) {
    const auto block = static_cast<std::size_t>(i);
    FindTriangles(volume, surfaces, block, &surfaces[block].triangles);
  });
  for (const BlockSurface& surface : surfaces)
    mesh.triangles.insert(mesh.triangles.end(), surface.triangles.begin(), surface.triangles.end());
  mesh.colours.resize(mesh.positions.size());
  mesh.normals = VertexNormals(mesh);
  return mesh;
}

}  // namespace nerf
