// What repair drops and what it keeps.
#include "nerf/surface/mesh_repair.h"

#include <gtest/gtest.h>

namespace {

using Eigen::Vector3f;

// A square of n x n quadrilaterals with a corner at `corner`, in the plane of x and y.
void AddSquare(const Vector3f& corner, float side, int n, io::Mesh* mesh) {
  const auto first = static_cast<std::uint32_t>(mesh->positions.size());
  const auto index = [&](int x, int y) { return first + static_cast<std::uint32_t>(y * (n + 1) + x); };
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      mesh->positions.push_back(corner + side / static_cast<float>(n) *
                                             Vector3f(static_cast<float>(x), static_cast<float>(y), 0));
      mesh->colours.push_back({static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), 7});
    }
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      mesh->triangles.push_back({index(x, y), index(x + 1, y), index(x + 1, y + 1)});
      mesh->triangles.push_back({index(x, y), index(x + 1, y + 1), index(x, y + 1)});
    }
  }
  mesh->normals = nerf::VertexNormals(*mesh);
}

TEST(MeshRepair, DropsPiecesByTheirShareOfTheArea) {
  io::Mesh mesh;
  AddSquare({0, 0, 0}, 1, 4, &mesh);     // area 1
  AddSquare({5, 0, 0}, 0.3f, 8, &mesh);  // 0.09, of more triangles
  AddSquare({0, 5, 0}, 0.1f, 1, &mesh);  // 0.01
  EXPECT_NEAR(nerf::Area(mesh), 1.1, 1e-6);
  EXPECT_EQ(nerf::DropSmallPieces(0.001, &mesh), 0);
  EXPECT_EQ(mesh.triangles.size(), 32u + 128u + 2u);
  EXPECT_EQ(nerf::DropSmallPieces(0.02, &mesh), 1);
  EXPECT_EQ(mesh.triangles.size(), 32u + 128u);
  EXPECT_EQ(nerf::DropSmallPieces(0.5, &mesh), 1);
  EXPECT_EQ(mesh.positions.size(), 25u);
  io::CheckMesh(mesh);
  EXPECT_NEAR(nerf::Area(mesh), 1, 1e-6);
}

TEST(MeshRepair, KeepsTrianglesAllOfWhoseVerticesAreKept) {
  io::Mesh mesh;
  AddSquare({0, 0, 0}, 1, 2, &mesh);
  std::vector<std::uint8_t> keep(9, 1);
  keep[0] = 0;  // a corner of two triangles
  nerf::KeepVertices(keep, &mesh);
  EXPECT_EQ(mesh.triangles.size(), 6u);
  EXPECT_EQ(mesh.positions.size(), 8u);
  EXPECT_EQ(mesh.colours[0], (std::array<std::uint8_t, 3>{1, 0, 7}));  // others moved up
  io::CheckMesh(mesh);
}

TEST(MeshRepair, EveryCornerOfATriangleCounts) {
  for (std::size_t corner = 0; corner < 3; ++corner) {
    io::Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    mesh.normals.assign(3, Vector3f::UnitZ());
    mesh.colours.resize(3);
    std::vector<std::uint8_t> keep(3, 1);
    keep[corner] = 0;
    nerf::KeepVertices(keep, &mesh);
    EXPECT_TRUE(mesh.triangles.empty()) << corner;
  }
}

TEST(MeshRepair, DecimationKeepsShapeAndWhatVerticesCarry) {
  io::Mesh mesh;
  AddSquare({0, 0, 0}, 1, 40, &mesh);
  for (Vector3f& p : mesh.positions) p.z() = p.x() < 0.5f ? 0 : 2 * (p.x() - 0.5f);  // a fold
  mesh.normals = nerf::VertexNormals(mesh);
  const io::Mesh before = mesh;
  nerf::Decimate(5000, &mesh);
  EXPECT_EQ(mesh.triangles.size(), 3200u);  // few enough
  nerf::Decimate(100, &mesh);
  EXPECT_LE(mesh.triangles.size(), 100u);
  EXPECT_GT(mesh.triangles.size(), 0u);
  EXPECT_NEAR(nerf::Area(mesh), nerf::Area(before), 0.02);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const auto x = static_cast<std::size_t>(mesh.colours[i][0]),
               y = static_cast<std::size_t>(mesh.colours[i][1]);
    EXPECT_EQ(mesh.positions[i], before.positions[41 * y + x]);
    EXPECT_EQ(mesh.normals[i], before.normals[41 * y + x]);
  }
}

TEST(MeshRepair, NormalsAreMeansByArea) {
  io::Mesh mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 1}, {9, 9, 9}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 1}};  // areas 2 along +z and 1 along +y
  const std::vector<Vector3f> normals = nerf::VertexNormals(mesh);
  EXPECT_TRUE(normals[0].isApprox(Vector3f(0, 1, 2).normalized()));
  EXPECT_TRUE(normals[2].isApprox(Vector3f::UnitZ()));
  EXPECT_TRUE(normals[3].isApprox(Vector3f::UnitY()));
  EXPECT_EQ(normals[4], Vector3f::UnitZ());  // of no triangle
}

}  // namespace
