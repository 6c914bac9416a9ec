// The whole surface from all training views, and the files made of it.
#include "pipeline/export/dense_surface.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/scene/ply.h"
#include "pipeline/export/points_export.h"
#include "pipeline/export/splats_export.h"
#include "tests/support/splat_renderer.h"

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

TEST_F(DenseSurfaceTest, SplatsAreFlatDiscsAcrossTheNormal) {
  const TargetFrame target = MakeTargetFrame({.points_apart = "0,0,0,0,0,1=0.25"}, {});
  ExportSplats(*surfels_, target, *dir_ / "metric.ply");
  auto columns = tests::PlyColumns(*dir_ / "metric.ply");
  EXPECT_EQ(columns.size(), 17u);
  ASSERT_EQ(columns["x"].size(), surfels_->size());
  for (std::size_t i = 0; i < surfels_->size(); ++i) {
    const Eigen::Quaterniond turn(
        columns["rot_0"][i], columns["rot_1"][i], columns["rot_2"][i], columns["rot_3"][i]);
    ASSERT_NEAR(turn.norm(), 1, 1e-6);
    const Eigen::Vector3d normal(columns["nx"][i], columns["ny"][i], columns["nz"][i]);
    ASSERT_LT((turn * Eigen::Vector3d::UnitZ() - normal).norm(), 1e-5);
    ASSERT_EQ(columns["scale_0"][i], columns["scale_1"][i]);
    ASSERT_LT(columns["scale_2"][i], columns["scale_0"][i] - 1);
    const double share = std::exp(columns["scale_0"][i]) / (0.25 * (*surfels_)[i].spacing);
    ASSERT_TRUE(share > 0.05 && share < 2) << share;
  }
}

TEST_F(DenseSurfaceTest, SplatsLookAsTheField) {
  ExportSplats(*surfels_, scene_->target, *dir_ / "splats.ply");
  const io::Rigid3d& pose = scene_->test.frames[0].world_from_cam;
  const nerf::RenderedView splats = tests::RenderSplats(*dir_ / "splats.ply", scene_->test.cameras[0], pose),
                           field = scene_->field->Render(scene_->test.cameras[0], pose, {});
  // Away from the edges of the chequers, which the field renders without any smoothing.
  const auto is_plain = [&](std::size_t x, std::size_t y) {
    for (std::size_t v = y - 1; v <= y + 1; ++v) {
      for (std::size_t u = x - 1; u <= x + 1; ++u)
        if (field.rgb[3 * (v * 96 + u)] != field.rgb[3 * (y * 96 + x)]) return false;
    }
    return field.opacity[y * 96 + x] > 0;
  };
  double squares = 0;
  int n = 0, n_holes = 0;
  for (std::size_t y = 1; y < 71; ++y) {
    for (std::size_t x = 1; x < 95; ++x) {
      if (!is_plain(x, y)) continue;
      const std::size_t pixel = y * 96 + x;
      n_holes += splats.opacity[pixel] < 0.9f;
      for (std::size_t c = 3 * pixel; c < 3 * pixel + 3; ++c, ++n)
        squares += std::pow(static_cast<double>(splats.rgb[c] - field.rgb[c]), 2);
    }
  }
  ASSERT_GT(n, 1000);
  const double psnr_db = -10 * std::log10(squares / n);
  EXPECT_GT(psnr_db, 22);
  EXPECT_EQ(n_holes, 0);
  RecordProperty("psnr_db", std::to_string(psnr_db));
}

}  // namespace
}  // namespace pipeline
