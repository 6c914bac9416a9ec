// One view of a slanted plane: what is fused from it, and which vertices it sees.
#include "nerf/surface/depth_fusion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "nerf/surface/seen_vertices.h"

namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

const Vector3d kNormal = Vector3d(0.4, -0.3, 1).normalized();
constexpr double kOffset = -2;  // the plane is normal . x = offset, before a camera at the origin

nerf::DepthView PlaneView() {
  nerf::DepthView view{.camera = {.width = 80, .height = 60, .fl_x = 100, .fl_y = 100, .cx = 40, .cy = 30},
                       .world_from_cam = {},
                       .cam_from_world = {},
                       .depth = {},
                       .rgb = {}};
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      const Vector3d ray((x + 0.5 - 40) / 100, -(y + 0.5 - 30) / 100, -1);
      view.depth.push_back(static_cast<float>(kOffset / kNormal.dot(ray)));
      view.rgb.insert(view.rgb.end(), {200, 100, static_cast<std::uint8_t>(x < 40 ? 0 : 50)});
    }
  }
  return view;
}

TEST(DepthFusion, ASlantedPlaneIsExactUpToTheTruncation) {
  const nerf::DepthView view = PlaneView();
  io::Workers workers(2);
  constexpr double kVoxel = 0.02, kTruncation = 0.08;
  const nerf::SparseVolume volume = nerf::FuseDepthViews(
      {&view, 1},
      {.box = {Vector3d(-2, -2, -4), Vector3d(2, 2, 0)}, .voxel = kVoxel, .truncation = kTruncation},
      &workers,
      [](double) {});
  int n_known = 0, n_truncated = 0;
  for (std::size_t b = 0; b < volume.size(); ++b) {
    for (std::size_t i = 0; i < nerf::SparseVolume::kSamples; ++i) {
      const double value = static_cast<double>(volume.block(b)[i]);
      if (std::isnan(value)) continue;
      const auto k = static_cast<int>(i);
      const Vector3d at = volume.Corner(b) + kVoxel * Vector3d(k % 8, k / 8 % 8, k / 64);
      const double exact = kNormal.dot(at) - kOffset;
      EXPECT_NEAR(value, std::min(exact, kTruncation), 1e-4);
      EXPECT_GT(exact, -kTruncation - 1e-4);
      ++n_known;
      n_truncated += exact > kTruncation + 1e-4;
    }
  }
  EXPECT_GT(n_known, 10000);
  EXPECT_GT(n_truncated, 1000);
}

TEST(SeenVertices, AreThoseOnTheSurfaceThatFaceTheView) {
  const nerf::DepthView view = PlaneView();
  io::Workers workers(1);
  const Vector3d ray(0.1, 0.05, -1), on_plane = kOffset / kNormal.dot(ray) * ray;
  io::Mesh mesh;
  for (const double share : {1.0, 1.3, 0.7}) mesh.positions.push_back((share * on_plane).cast<float>());
  mesh.positions.push_back(mesh.positions[0]);   // from behind
  mesh.positions.push_back(-mesh.positions[0]);  // behind the camera
  mesh.positions.push_back(Vector3f(5, 0, -2));  // outside of the picture
  mesh.normals.assign(6, kNormal.cast<float>());
  mesh.normals[3] = -mesh.normals[3];
  mesh.colours.assign(6, {1, 2, 3});
  EXPECT_EQ(nerf::ColourVertices({&view, 1}, &workers, &mesh), (std::vector<int>{1, 0, 0, 0, 0, 0}));
  EXPECT_EQ(mesh.colours[0], (std::array<std::uint8_t, 3>{200, 100, 50}));
  for (std::size_t i = 1; i < 6; ++i) EXPECT_EQ(mesh.colours[i], (std::array<std::uint8_t, 3>{1, 2, 3}));
}

}  // namespace
