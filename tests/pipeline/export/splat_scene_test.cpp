// Splats of the sphere whose pictures are known, and of fields that show nothing or sky.
#include "pipeline/export/splat_scene.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/image/mask.h"
#include "nerf/splatting/plain_rasteriser.h"
#include "pipeline/export/splat_quality.h"
#include "tests/support/files/sphere_export.h"

namespace pipeline {
namespace {

// Rays meet nothing.
class EmptyField : public tests::SphereField {
 public:
  explicit EmptyField(bool has_sky) : has_sky_(has_sky) {}
  nerf::RenderedView Render(const io::Camera& camera,
                            const io::Rigid3d& pose,
                            const nerf::RenderOptions& options) const override {
    nerf::RenderedView view = SphereField::Render(camera, pose, options);
    view.median_depth.assign(view.median_depth.size(), std::numeric_limits<float>::infinity());
    return view;
  }
  bool HasUnknownSpace() const override { return has_sky_; }

 private:
  const bool has_sky_;
};

double MeanOpacity(const nerf::Splats& splats) {
  double sum = 0;
  for (const float logit : splats.opacities) sum += 1 / (1 + std::exp(-static_cast<double>(logit)));
  return sum / static_cast<double>(splats.size());
}

TEST(SplatScene, ComesNearTheField) {
  const TempDir dir;
  const ExportedScene scene = tests::SphereExport(dir.path());
  const nerf::Splats first = MakeSplats(scene, {.view_size = 0, .max_splats = 3000, .steps = 0}),
                     fitted = MakeSplats(scene, {.view_size = 0, .max_splats = 3000, .steps = 150});
  // The sphere covers a fourth of the pictures.
  EXPECT_GT(first.size(), 500u);
  EXPECT_LT(first.size(), 1500u);
  EXPECT_EQ(fitted.size(), first.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    const Eigen::Vector3d place = Eigen::Vector3f(&first.places[3 * i]).cast<double>();
    ASSERT_NEAR(place.norm(), 1, 1e-3);
    const float* q = &first.rotations[4 * i];
    const Eigen::Vector3d normal = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * Eigen::Vector3d::UnitZ();
    ASSERT_GT(normal.dot(place), 0.9);
    ASSERT_EQ(first.log_scales[3 * i], first.log_scales[3 * i + 1]);
    ASSERT_LT(first.log_scales[3 * i + 2], first.log_scales[3 * i] - 1);
  }
  const auto before = MeasureSplats(scene, first), after = MeasureSplats(scene, fitted);
  ASSERT_TRUE(before && after);
  EXPECT_EQ(after->views, 4);
  EXPECT_GT(before->apart_db, 15);
  EXPECT_GT(after->apart_db, 19);
  // A fifth of the light passes the first ones; nearly none the sphere.
  EXPECT_GT(MeanOpacity(fitted), MeanOpacity(first) + 0.1);
  RecordProperty("apart_db", std::to_string(after->apart_db));
}

TEST(SplatScene, QualityIsThatOfThePhotos) {
  // Photos are black; the field is grey where it is not the sphere.
  const TempDir dir;
  ExportedScene scene = tests::SphereExport(dir.path());
  const auto quality = MeasureSplats(scene, {});
  ASSERT_TRUE(quality);
  EXPECT_NEAR(quality->splats_db, -20 * std::log10(140 / 255.0), 1e-6);  // 0.55 is 140 in 8 bits
  EXPECT_LT(quality->field_db, quality->splats_db + 3);
  EXPECT_GT(quality->apart_db, quality->splats_db);
  scene.crop = nerf::CropBox{};
  EXPECT_FALSE(MeasureSplats(scene, {}));
  scene.crop.reset();
  scene.test.frames.clear();
  EXPECT_FALSE(MeasureSplats(scene, {}));
}

TEST(SplatScene, SkyIsFarAndFreeSpaceStaysEmpty) {
  const TempDir dir;
  ExportedScene scene = tests::SphereExport(dir.path());
  scene.field = std::make_unique<EmptyField>(true);
  const nerf::Splats sky = MakeSplats(scene, {.max_splats = 500, .steps = 0});
  ASSERT_GT(sky.size(), 400u);
  for (std::size_t i = 0; i < sky.size(); ++i)
    ASSERT_NEAR(Eigen::Vector3f(&sky.places[3 * i]).norm(), 300, 5);
  scene.field = std::make_unique<EmptyField>(false);
  EXPECT_ERROR(MakeSplats(scene, {.steps = 0}), io::ExitCode::kBadState, "show no surface");
}

TEST(SplatScene, SkyIsAddedToSplatsThatLeaveItOut) {
  const TempDir dir;
  ExportedScene scene = tests::SphereExport(dir.path());
  nerf::Splats trained;
  trained.resize(1);
  trained.rotations[0] = 1;
  scene.field = std::make_unique<EmptyField>(true);
  const nerf::Splats all = WithSky(scene, trained, {.max_splats = 500});
  ASSERT_GT(all.size(), 300u);
  EXPECT_EQ(all.colours.size(), 3 * nerf::kHarmonics * all.size());
  EXPECT_EQ(all.places[0], 0);
  for (std::size_t i = 1; i < all.size(); ++i)
    ASSERT_NEAR(Eigen::Vector3f(&all.places[3 * i]).norm(), 300, 5);
  // A field that knows of no sky, and splats that hide it.
  scene.field = std::make_unique<EmptyField>(false);
  EXPECT_EQ(WithSky(scene, trained, {}).size(), 1u);
  scene.field = std::make_unique<EmptyField>(true);
  trained.opacities[0] = 9;
  for (float& scale : trained.log_scales) scale = std::log(3.f);
  EXPECT_EQ(WithSky(scene, trained, {}).size(), 1u);
}

TEST(SplatScene, PhotosAreTheAimWhereTheirMasksUseThem) {
  // Photos are black, the field is grey; the right half of the picture is masked.
  const TempDir dir;
  ExportedScene scene = tests::SphereExport(dir.path());
  scene.field = std::make_unique<EmptyField>(true);
  io::Mask mask{.width = 96, .height = 72, .used = std::vector<std::uint8_t>(96 * 72)};
  for (std::size_t i = 0; i < mask.used.size(); ++i) mask.used[i] = i % 96 < 48 ? 255 : 0;
  io::WriteMask(dir / "mask.png", mask);
  scene.train.frames.resize(1);
  scene.train.frames[0].mask_path = dir / "mask.png";
  const nerf::Splats splats = MakeSplats(scene, {.view_size = 48, .max_splats = 4000, .steps = 150});
  const std::vector<double> rgb = nerf::RenderPlainly(
      splats, {scene.train.cameras[0], scene.train.frames[0].world_from_cam}, {0.5, 0.5, 0.5});
  double left = 0, right = 0;
  for (std::size_t i = 0; i < rgb.size(); ++i) (i / 3 % 96 < 48 ? left : right) += 2 * rgb[i] / rgb.size();
  EXPECT_LT(left, 0.2);
  EXPECT_NEAR(right, 0.55, 0.1);
}

}  // namespace
}  // namespace pipeline
