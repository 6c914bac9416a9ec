// Places, normals and support of what a view shows, on a sphere where all are known.
#include "pipeline/export/view_surface.h"

#include <gtest/gtest.h>

#include "tests/support/files/sphere_export.h"

namespace pipeline {
namespace {

TEST(ViewSurface, IsTheSphereWithItsNormals) {
  const TempDir dir;
  const ExportedScene scene = tests::SphereExport(dir.path());
  const io::Rigid3d& pose = scene.test.frames[0].world_from_cam;
  const ViewSurface view = MeasureSurface(scene, scene.test.cameras[0], pose);
  ASSERT_EQ(view.width, 96);
  ASSERT_EQ(view.distance.size(), 96u * 72u);
  EXPECT_EQ(view.rgb.size(), 3 * view.distance.size());
  int n = 0, n_steep = 0;
  for (std::size_t i = 0; i < view.distance.size(); ++i) {
    if (view.distance[i] == 0) {
      EXPECT_EQ(view.support[i], 0);
      EXPECT_TRUE(view.normals[i].isZero());
      continue;
    }
    const Eigen::Vector3d point = pose.translation + static_cast<double>(view.distance[i]) * view.rays[i];
    EXPECT_NEAR(point.norm(), 1, 1e-6);
    const double slant = -point.dot(view.rays[i]);
    ++n, n_steep += slant < 0.4;
    if (slant < 0.4) continue;
    // Five pixels span a twelfth of the radius.
    EXPECT_GT(view.normals[i].cast<double>().dot(point), std::cos(0.06)) << i;
    EXPECT_GE(view.support[i], 3);
  }
  EXPECT_GT(n, 600);
  EXPECT_LT(n_steep, n / 4);
}

TEST(ViewSurface, PlanesDoNotReachOverEdges) {
  // Two walls that face the camera, one behind the other: no normal may lean across the step.
  class Steps : public tests::SphereField {
   public:
    nerf::RenderedView Render(const io::Camera& camera,
                              const io::Rigid3d& pose,
                              const nerf::RenderOptions& options) const override {
      nerf::RenderedView view = SphereField::Render(camera, pose, options);
      for (std::size_t i = 0; i < view.median_depth.size(); ++i) {
        const auto x = static_cast<double>(i % static_cast<std::size_t>(camera.width)) + 0.5,
                   y = static_cast<double>(i / static_cast<std::size_t>(camera.width)) + 0.5;
        const double depth = x < 0.5 * camera.width ? 3 : 4;
        view.median_depth[i] = static_cast<float>(depth / -io::RayFromImg(camera, {x, y})->z());
      }
      return view;
    }
  };
  const TempDir dir;
  ExportedScene scene = tests::SphereExport(dir.path());
  scene.field = std::make_unique<Steps>();
  const io::Rigid3d& pose = scene.train.frames[0].world_from_cam;
  const ViewSurface view = MeasureSurface(scene, scene.train.cameras[0], pose);
  for (std::size_t i = 0; i < view.normals.size(); ++i) {
    ASSERT_GT(view.normals[i].cast<double>().dot(pose.rotation.col(2)), 0.9999);
    const int from_step = std::abs(2 * static_cast<int>(i % 96) - 95);  // 1: beside it
    ASSERT_EQ(view.evenness[i] < 1, from_step <= 3) << from_step;
    if (from_step == 1) {
      ASSERT_NEAR(view.evenness[i], 0.6, 1e-6);
    }
  }
}

}  // namespace
}  // namespace pipeline
