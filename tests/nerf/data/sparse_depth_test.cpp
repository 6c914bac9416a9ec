// Depths of sparse points: where they fall in the pictures, and which of them are trusted.
#include "nerf/data/sparse_depth.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf {
namespace {

// Three cameras of 4 x 4 pixels, in a row from the origin along +x, looking along -z.
io::Scene ThreeCameras() {
  io::Scene scene;
  io::Camera camera;
  camera.width = camera.height = 4;
  camera.fl_x = camera.fl_y = 2, camera.cx = camera.cy = 2;
  scene.cameras.push_back(camera);
  for (int i = 0; i < 3; ++i) {
    io::Frame frame;
    frame.world_from_cam.translation = {0.5 * i, 0, 0};
    scene.frames.push_back(frame);
  }
  return scene;
}

Dataset DatasetOf(const io::Scene& scene) {
  Dataset dataset;
  for (std::size_t v = 0; v < scene.frames.size(); ++v)
    dataset.views.push_back(
        {"view", RayCamera(scene.cameras[0], scene.frames[v].world_from_cam), 4, 4, 16 * v});
  dataset.pixels.assign(3 * 16 * scene.frames.size(), 0);
  return dataset;
}

TEST(SparseDepths, LieWhereTheirObserversSeeThePoint) {
  io::Scene scene = ThreeCameras();
  scene.points.push_back({.xyz = {0, 0, -2}, .frame_indices = {0}});
  scene.points.push_back({.xyz = {0.5, 0.25, -2}, .frame_indices = {0, 1, 2}});
  const Dataset dataset = DatasetOf(scene);
  const std::vector<SparseDepth> depths = SparseDepths(scene, dataset);
  ASSERT_EQ(depths.size(), 3u);
  for (std::size_t v = 0; v < 3; ++v) {
    EXPECT_EQ(depths[v].view, v);
    EXPECT_EQ(depths[v].point, 1u);
    EXPECT_NEAR(depths[v].x, 2.5 - 0.5 * static_cast<double>(v), 1e-6);
    EXPECT_NEAR(depths[v].y, 1.75, 1e-6) << "y is up in the scene and down in the picture";
    const double aside = 0.5 - 0.5 * static_cast<double>(v);
    EXPECT_NEAR(depths[v].t, std::sqrt(aside * aside + 0.0625 + 4), 1e-6)
        << "along the ray, not along the axis";
    EXPECT_EQ(dataset.PixelOf(depths[v]), 16 * v + 4 + (v == 0 ? 2 : v == 1 ? 2 : 1));
  }
}

TEST(SparseDepths, OfFewObserversOutsideThePictureOrBehindTheCameraAreLeftOut) {
  io::Scene scene = ThreeCameras();
  scene.points.push_back({.xyz = {0.5, 0.25, -2}, .frame_indices = {0, 1}});
  scene.points.push_back({.xyz = {0.5, 0.25, -2}, .frame_indices = {}});
  scene.points.push_back({.xyz = {0.5, 0.25, 2}, .frame_indices = {0, 1, 2}});
  scene.points.push_back({.xyz = {0.5, 9, -2}, .frame_indices = {0, 1, 2}});
  EXPECT_TRUE(SparseDepths(scene, DatasetOf(scene)).empty());
}

// In double the first point lies before the picture's right edge, in float on it. The others are so far or so
// near that their distance is no float.
TEST(SparseDepths, ThatFloatCannotHoldAreLeftOut) {
  io::Scene scene = ThreeCameras();
  for (io::Frame& frame : scene.frames) frame.world_from_cam.translation.setZero();
  scene.points.push_back({.xyz = {2 - 1e-9, 0, -2}, .frame_indices = {0, 1, 2}});
  scene.points.push_back({.xyz = {0, 0, -1e60}, .frame_indices = {0, 1, 2}});
  scene.points.push_back({.xyz = {0, 0, -1e-60}, .frame_indices = {0, 1, 2}});
  EXPECT_TRUE(SparseDepths(scene, DatasetOf(scene)).empty());
}

TEST(SparseDepths, OnMaskedPixelsAreLeftOut) {
  io::Scene scene = ThreeCameras();
  scene.points.push_back({.xyz = {0.5, 0.25, -2}, .frame_indices = {0, 1, 2}});
  Dataset dataset = DatasetOf(scene);
  dataset.runs = PixelRuns({{0, 0}, {6, 7}, {47, 48}});  // all but pixel 6, that of the first view
  const std::vector<SparseDepth> depths = SparseDepths(scene, dataset);
  ASSERT_EQ(depths.size(), 2u);
  EXPECT_EQ(depths[0].view, 1u);
}

}  // namespace
}  // namespace nerf
