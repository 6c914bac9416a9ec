// The constants of an unbounded scene follow from what its cameras see.
#include "nerf/fields/scene_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "io/image/image.h"
#include "io/image/mask.h"
#include "tests/support/files/picture_scene.h"
#include "tests/support/files/temp_dir.h"

namespace nerf {
namespace {

using Eigen::Vector3d;

// Three cameras at the origin, 20 x 15 pixels, focal length 100, looking along -z.
io::Scene ThreeCameras() {
  io::Scene scene;
  scene.cameras.push_back({.width = 20, .height = 15, .fl_x = 100, .fl_y = 100, .cx = 10, .cy = 7.5});
  scene.frames.resize(3);
  scene.aabb = {Vector3d(-2, -2, -6), Vector3d(2, 2, -2)};
  scene.unbounded = true;
  return scene;
}

std::unique_ptr<SceneField> FieldOf(const io::Scene& scene, std::string* derivation) {
  Dataset dataset;
  for (std::size_t v = 0; v < scene.frames.size(); ++v)
    dataset.views.push_back(
        {"view", RayCamera(scene.cameras[0], scene.frames[v].world_from_cam), 20, 15, 300 * v});
  dataset.pixels.assign(3 * 300 * scene.frames.size(), 0);
  io::Workers workers(1);
  const SceneFieldOptions options{.log2_hashmap_size = 10, .finest_cell_pixels = 1, .grid_resolution = 64};
  return MakeSceneField(scene, dataset, options, 1, &workers, derivation);
}

TEST(UnboundedSpace, ReachesAsFarAsCamerasSeeInTheMedian) {
  io::Scene scene = ThreeCameras();
  scene.points.push_back({.xyz = {0, 0, -1}, .frame_indices = {0}});
  scene.points.push_back({.xyz = {0, 0, -3}, .frame_indices = {0, 1, 2}});
  scene.points.push_back({.xyz = {0, 0, -20}, .frame_indices = {1}});
  std::string derivation;
  const auto field = FieldOf(scene, &derivation);
  EXPECT_FLOAT_EQ(field->contraction.half, 3);
  EXPECT_FLOAT_EQ(field->sampler_options.near, 0.5f) << "half of the nearest";
  EXPECT_FLOAT_EQ(field->sampler_options.far, 12) << "twice that of the scene, where few see farther";
  EXPECT_FLOAT_EQ(field->sampler_options.cone_angle, 0.04f) << "4 pixels";
  EXPECT_FLOAT_EQ(field->sampler_options.step_size, 0.06f) << "2 pixels where the median point lies";
  const double cell = field->contraction.InnerSide() / field->field->Config().at("finest_resolution");
  EXPECT_NEAR(cell, 0.03, 1e-3) << "a pixel there";
}

TEST(UnboundedSpace, WithoutObserversAllPicturesThatShowAPointCount) {
  io::Scene scene = ThreeCameras();
  scene.points.push_back({.xyz = {0, 0, -5}});
  scene.points.push_back({.xyz = {0, 0, 1}});   // behind all of them
  scene.points.push_back({.xyz = {5, 0, -7}});  // beside their pictures
  std::string derivation;
  EXPECT_FLOAT_EQ(FieldOf(scene, &derivation)->contraction.half, 5);
}

TEST(UnboundedSpace, WithoutPointsTheRegionOfInterestDecides) {
  std::string derivation;
  const auto field = FieldOf(ThreeCameras(), &derivation);
  EXPECT_FLOAT_EQ(field->contraction.half, 2);
  EXPECT_NE(derivation.find("no sparse points"), std::string::npos);
}

TEST(UnboundedSpace, PointsAtAbsurdDistancesLeaveItUsable) {
  for (const double z : {-1e-200, -1e200}) {
    io::Scene scene = ThreeCameras();
    scene.points.push_back({.xyz = {0, 0, z}, .frame_indices = {0, 1, 2}});
    std::string derivation;
    const auto field = FieldOf(scene, &derivation);
    EXPECT_GE(field->contraction.half, 0.009 * scene.near);
    EXPECT_LE(field->contraction.half, 101 * scene.far);
    EXPECT_GT(field->sampler_options.step_size, 1e-6f);
    EXPECT_TRUE(std::isfinite(field->sampler_options.far));
  }
}

// Cut-outs whose masks use one half of the space: nothing is to be found in the other, whose density no
// training ray would change. Nor is anything above, where they are transparent.
TEST(BoundedSpace, WhatMasksLeaveOutIsEmpty) {
  const TempDir dir;
  io::Image cut_out = io::MakeImage(20, 20, 4);
  std::fill(cut_out.data.begin(), cut_out.data.end(), 255);
  for (std::size_t i = 0; i < 160; ++i) cut_out.data[4 * i + 3] = 0;  // 8 rows at the top
  io::Mask left{20, 20, {}}, right;
  for (int i = 0; i < 400; ++i) left.used.push_back(i % 20 < 10 ? 255 : 0);
  right = left;
  std::reverse(right.used.begin(), right.used.end());
  io::WriteImage(dir / "a.png", cut_out);
  io::WriteMask(dir / "left.png", left);
  io::WriteMask(dir / "right.png", right);
  io::Scene scene = tests::SceneOf({dir / "a.png", dir / "a.png"}, 20, 20);
  scene.aabb = {Vector3d::Constant(-1), Vector3d::Constant(1)};
  scene.near = 2, scene.far = 6;
  scene.frames[0].world_from_cam.translation.z() = 4;
  scene.frames[1].world_from_cam.translation.z() = -4;
  scene.frames[1].world_from_cam.rotation.diagonal() << -1, 1, -1;  // its left is the first one's right
  io::Workers workers(1);
  float highest = -1;
  const auto candidates = [&] {
    std::string derivation;
    const SceneFieldOptions options{.log2_hashmap_size = 10, .finest_cell_pixels = 1, .grid_resolution = 64};
    const auto field = MakeSceneField(scene, LoadDataset(scene, 1), options, 1, &workers, &derivation);
    std::vector<float> x;
    highest = -1;
    for (const std::uint32_t cell : field->grid.Candidates()) {
      float at[3];
      field->contraction.FromUnit(field->grid.CellCentre(cell).data(), at);
      x.push_back(at[0]);
      if (at[0] < -0.1f) highest = std::max(highest, at[1]);  // not on the masks' edge
    }
    return x;
  };
  const std::vector<float> all = candidates();
  EXPECT_GT(*std::max_element(all.begin(), all.end()), 0.5f);
  scene.frames[0].mask_path = dir / "left.png";
  scene.frames[1].mask_path = dir / "right.png";
  const std::vector<float> used = candidates();
  EXPECT_FALSE(used.empty());
  EXPECT_LT(*std::max_element(used.begin(), used.end()), 0.1f);
  EXPECT_LT(highest, 0.6f);
}

}  // namespace
}  // namespace nerf
