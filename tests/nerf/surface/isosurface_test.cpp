// The zero set of functions whose surface is known.
#include "nerf/surface/isosurface.h"

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <numbers>

#include "io/base/error.h"
#include "nerf/surface/mesh_repair.h"
#include "tests/support/files/temp_dir.h"

namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using Eigen::Vector3i;

constexpr double kVoxel = 0.05;
const Vector3d kOrigin(-1.13, -1.17, -1.11);

// Six blocks per side, less those that `has` leaves out.
nerf::SparseVolume Sample(
    const std::function<double(const Vector3d&)>& f,
    const std::function<bool(const Vector3i&)>& has = [](const Vector3i&) { return true; }) {
  std::vector<Vector3i> places;
  for (int i = 0; i < 6 * 6 * 6; ++i) {
    const Vector3i place(i / 36, i / 6 % 6, i % 6);
    if (has(place)) places.push_back(place);
  }
  nerf::SparseVolume volume(kOrigin, kVoxel, places);
  for (std::size_t b = 0; b < volume.size(); ++b) {
    for (int z = 0; z < 8; ++z) {
      for (int y = 0; y < 8; ++y) {
        for (int x = 0; x < 8; ++x) {
          const Vector3d at = volume.Corner(b) + kVoxel * Vector3d(x, y, z);
          volume.block(b)[nerf::SparseVolume::Index(x, y, z)] = static_cast<float>(f(at));
        }
      }
    }
  }
  return volume;
}

io::Mesh Extract(const nerf::SparseVolume& volume, int threads = 2) {
  io::Workers workers(threads);
  return nerf::ExtractIsosurface(volume, &workers);
}

double Ball(const Vector3d& p) { return p.norm() - 0.8; }

TEST(Isosurface, BallIsClosedAndFacesOutwards) {
  const io::Mesh mesh = Extract(Sample(Ball));
  io::CheckMesh(mesh);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_NEAR(mesh.positions[i].norm(), 0.8, 0.03 * kVoxel);
    EXPECT_GT(mesh.normals[i].dot(mesh.positions[i].normalized()), 0.99f);
  }
  EXPECT_NEAR(nerf::Area(mesh), 4 * std::numbers::pi * 0.64, 0.01 * 4 * std::numbers::pi * 0.64);
  // Every edge belongs to two triangles, which pass it in opposite directions.
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> passes;
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++passes[{triangle[k], triangle[(k + 1) % 3]}];
  }
  for (const auto& [edge, n] : passes) {
    ASSERT_EQ(n, 1);
    ASSERT_EQ(passes.count({edge.second, edge.first}), 1u);
  }
  // Euler's formula for a sphere.
  EXPECT_EQ(mesh.positions.size() + mesh.triangles.size(), passes.size() / 2 + 2);
}

TEST(Isosurface, PlanesAreExact) {
  const Vector3d normal = Vector3d(0.3, -0.5, 0.9).normalized();
  const io::Mesh mesh = Extract(Sample([&](const Vector3d& p) { return normal.dot(p) - 0.123; }));
  ASSERT_GT(mesh.positions.size(), 1000u);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_NEAR(normal.dot(mesh.positions[i].cast<double>()), 0.123, 1e-6);
    if (mesh.positions[i].cwiseAbs().maxCoeff() < 1) {  // at the lattice's end triangles may be points
      EXPECT_NEAR(normal.dot(mesh.normals[i].cast<double>()), 1, 1e-4);
    }
  }
}

TEST(Isosurface, EndsWhereNothingIsKnown) {
  nerf::SparseVolume volume = Sample(Ball, [](const Vector3i& place) { return place.x() < 3; });
  const float edge = static_cast<float>(kOrigin.x() + 23 * kVoxel);  // the last sample of the blocks
  float farthest = -1;
  for (const Vector3f& p : Extract(volume).positions) farthest = std::max(farthest, p.x());
  EXPECT_LE(farthest, edge + 1e-5f);
  EXPECT_GT(farthest, edge - 0.8f * static_cast<float>(kVoxel));
  // An unknown sample takes the cells around it out, and no others.
  const std::size_t before = Extract(volume).triangles.size();
  for (std::size_t b = 0; b < volume.size(); ++b) {
    for (float& value : volume.block(b)) {
      if (std::abs(value) > 0.002f || before == 0) continue;
      value = nerf::SparseVolume::kUnknown;
      const std::size_t after = Extract(volume).triangles.size();
      EXPECT_LT(after, before);
      EXPECT_GT(after + 40, before);
      return;
    }
  }
  FAIL() << "no sample near the surface";
}

TEST(Isosurface, IsTheSameForAnyNumberOfThreads) {
  const nerf::SparseVolume volume = Sample(Ball);
  const io::Mesh one = Extract(volume, 1), three = Extract(volume, 3);
  EXPECT_EQ(one.positions, three.positions);
  EXPECT_EQ(one.triangles, three.triangles);
}

TEST(SparseVolume, FindsItsBlocks) {
  const nerf::SparseVolume volume(kOrigin, kVoxel, {{0, 0, 0}, {-1, 5, 7}, {5, -1, 7}});
  EXPECT_EQ(volume.Find({-1, 5, 7}), 1);
  EXPECT_EQ(volume.Find({5, -1, 7}), 2);
  EXPECT_EQ(volume.Find({7, 5, -1}), -1);
  EXPECT_TRUE(volume.Corner(1).isApprox(kOrigin + 8 * kVoxel * Vector3d(-1, 5, 7)));
  EXPECT_TRUE(std::isnan(volume.block(0)[511]));
  EXPECT_ERROR(
      nerf::SparseVolume(kOrigin, kVoxel, {{1, 1, 1}, {1, 1, 1}}), io::ExitCode::kInternal, "sparse_volume");
}

}  // namespace
