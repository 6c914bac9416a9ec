// The whole surface from all training views, and the files made of it.
#include "pipeline/export/dense_surface.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/scene/ply.h"
#include "pipeline/export/points_export.h"
#include "tests/support/files/sphere_export.h"

namespace pipeline {
namespace {

class DenseSurfaceTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new TempDir();
    scene_ = new ExportedScene(tests::SphereExport(dir_->path()));
    surfels_ = new std::vector<Surfel>(DenseSurface(*scene_, {.view_size = 0, .max_points = 100000}));
  }
  static void TearDownTestSuite() {
    delete surfels_;
    delete scene_;
    delete dir_;
  }
  static inline TempDir* dir_ = nullptr;
  static inline ExportedScene* scene_ = nullptr;
  static inline std::vector<Surfel>* surfels_ = nullptr;
};

TEST_F(DenseSurfaceTest, LiesOnTheSphereAndFacesOutwards) {
  EXPECT_GT(surfels_->size(), 5000u);
  for (const Surfel& surfel : *surfels_) {
    ASSERT_NEAR(surfel.position.norm(), 1, 2e-3);
    ASSERT_GT(surfel.normal.dot(surfel.position), 0.98);
    ASSERT_GE(surfel.support, 2);
    ASSERT_LT(surfel.spacing, 0.1);
    // The sphere's colours, light or dark, not the background's.
    ASSERT_NEAR(surfel.rgb.z() / surfel.rgb.x(), 0.6, 1e-3);
  }
}

TEST_F(DenseSurfaceTest, IsThinnedAndRenderedAtTheSizesAskedFor) {
  const std::vector<Surfel> few = DenseSurface(*scene_, {.view_size = 0, .max_points = 500});
  EXPECT_LE(few.size(), 500u);
  EXPECT_GT(few.size(), 250u);
  EXPECT_LT(DenseSurface(*scene_, {.view_size = 24}).size(), surfels_->size() / 4);
}

TEST_F(DenseSurfaceTest, WithoutAgreementThereIsNothing) {
  ExportedScene lonely = tests::SphereExport(*dir_ / "lonely", {}, 1);
  EXPECT_ERROR(
      DenseSurface(lonely, {}), io::ExitCode::kBadState, dir_->path().string(), "no two training views");
}

TEST_F(DenseSurfaceTest, PointsComeBackInTheTargetFrame) {
  const TargetFrame target = MakeTargetFrame({.frame = "sfm"}, scene_->train.scene_from_sfm);
  ExportPoints(*surfels_, target, *dir_ / "points.ply");
  auto columns = tests::PlyColumns(*dir_ / "points.ply");
  EXPECT_EQ(columns.size(), 10u);
  const std::vector<io::Point3D> read = io::ReadPly(*dir_ / "points.ply");
  ASSERT_EQ(read.size(), surfels_->size());
  const io::Sim3d scene_from_target = target.target_from_scene.Inverse();
  for (std::size_t i = 0; i < read.size(); ++i) {
    const Surfel& surfel = (*surfels_)[i];
    ASSERT_LT((scene_from_target * read[i].xyz - surfel.position).norm(), 1e-5);
    const Eigen::Vector3d normal(columns["nx"][i], columns["ny"][i], columns["nz"][i]);
    ASSERT_LT((scene_from_target.rotation * normal - surfel.normal).norm(), 1e-6);
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(read[i].rgb[static_cast<std::size_t>(c)], 255 * surfel.rgb[c], 0.51);
    ASSERT_EQ(columns["support"][i], surfel.support);
  }
}

}  // namespace
}  // namespace pipeline
