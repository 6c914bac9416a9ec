// Pictures of a checkpoint with splats: how large the field's part is drawn, and what is near the camera.
#include "nerf/rendering/trained_field.h"

#include <gtest/gtest.h>

#include <cmath>

#include "nerf/fields/checkpoint.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/small_field.h"
#include "tests/support/scenes/some_splats.h"

namespace nerf {
namespace {

std::unique_ptr<TrainedField> SomeField(const Splats& splats, float step_scale = 1) {
  SceneField scene_field = tests::SmallField();
  for (std::uint32_t cell = 0; cell < scene_field.grid.n_cells(); ++cell) scene_field.grid.SetCandidate(cell);
  scene_field.grid.Rebuild();
  scene_field.background = {0.9f, 0.1f, 0.4f};  // so that the fog in the cube has an edge
  scene_field.splats = splats;
  scene_field.splat_focal_px = 60;
  scene_field.step_scale = step_scale;
  const TempDir dir;
  WriteCheckpoint(dir / "checkpoint.bin", &scene_field, {});
  return TrainedField::Load(dir / "checkpoint.bin");
}

TEST(TrainedField, UnderSplatsAFieldOfALimitedFocalLengthIsMagnified) {
  const SplatView view = tests::SomeView(80, 60);
  const auto field = SomeField(tests::SomeSplats(40));
  const RenderOptions limited{.field_focal_px = 0.5 * view.camera.fl_x};
  const io::Camera small = field->FieldCamera(view.camera, limited);
  EXPECT_EQ(small.width, 40);
  EXPECT_EQ(small.height, 30);
  EXPECT_NEAR(small.fl_x, 0.5 * view.camera.fl_x, 1e-9);

  RenderedView steps = field->Render(small, view.world_from_cam, {.splats = false});
  field->AddSplats(view.camera, view.world_from_cam, limited, &steps);
  const RenderedView at_once = field->Render(view.camera, view.world_from_cam, limited);
  EXPECT_EQ(at_once.width, 80);
  EXPECT_EQ(at_once.rgb, steps.rgb);
  EXPECT_EQ(at_once.depth, steps.depth);
  const RenderedView whole = field->Render(view.camera, view.world_from_cam, {});
  EXPECT_NE(at_once.rgb, whole.rgb);
  // Fine structure is that of the splats alone; the means of blocks agree, and would not were the splats or
  // the field at another place.
  for (std::size_t block = 0; block < 8 * 6; ++block) {
    const auto mean = [&](const RenderedView& picture) {
      double sum = 0;
      for (std::size_t i = 0; i < 100; ++i) {
        const std::size_t x = block % 8 * 10 + i % 10, y = block / 8 * 10 + i / 10;
        sum += picture.rgb[3 * (80 * y + x)] / 100.0;
      }
      return sum;
    };
    EXPECT_NEAR(mean(at_once), mean(whole), 0.01) << block;
  }
}

TEST(TrainedField, WhereNoSplatsAreShownTheFieldHasThePicturesSize) {
  const SplatView view = tests::SomeView(40, 30);
  const RenderOptions limited{.field_focal_px = 10};
  RenderOptions ended = limited, depth = limited, without = limited, longer = limited;
  ended.limits.end = 5;
  depth.depth_only = true;
  without.splats = false;
  longer.field_focal_px = view.camera.fl_x;
  const auto splats = SomeField(tests::SomeSplats(40)), none = SomeField({});
  EXPECT_EQ(splats->FieldCamera(view.camera, ended), view.camera);
  EXPECT_EQ(splats->FieldCamera(view.camera, depth), view.camera);
  EXPECT_EQ(splats->FieldCamera(view.camera, without), view.camera);
  EXPECT_EQ(splats->FieldCamera(view.camera, longer), view.camera);
  EXPECT_EQ(splats->FieldCamera(view.camera, {}), view.camera);
  EXPECT_EQ(none->FieldCamera(view.camera, limited), view.camera);
  EXPECT_EQ(none->Render(view.camera, view.world_from_cam, limited).rgb,
            none->Render(view.camera, view.world_from_cam, {}).rgb);
}

TEST(TrainedField, InACropBoxSplatsAreShownThatLieInIt) {
  const SplatView view = tests::SomeView(40, 30);
  RenderOptions options;
  options.limits.crop = CropBox{.size = {1.2, 1.2, 1.2}};
  const Splats all = tests::SomeSplats(60);
  const Splats inside =
      SplatsWhere(all, [&](const Eigen::Vector3d& middle) { return middle.cwiseAbs().maxCoeff() < 0.6; });
  ASSERT_TRUE(inside.size() > 10 && inside.size() < 50) << inside.size();
  const auto picture = [&](const Splats& splats) {
    return SomeField(splats)->Render(view.camera, view.world_from_cam, options).rgb;
  };
  EXPECT_EQ(picture(all), picture(inside));
  EXPECT_NE(picture(all), picture({}));
}

TEST(TrainedField, WhileTrainingGoesOnItsIntervalsAreThoseOfPictures) {
  const SplatView view = tests::SomeView(40, 30);
  const auto rendered = [&](float of_field, float of_options) {
    return SomeField({}, of_field)->Render(view.camera, view.world_from_cam, {.step_scale = of_options}).rgb;
  };
  EXPECT_EQ(rendered(3, 1), rendered(1, 3));
  EXPECT_EQ(rendered(3, 0), rendered(1, 3 * FinestStepScale(1)));
  EXPECT_NE(rendered(3, 1), rendered(1, 1));
}

TEST(TrainedField, DepthAloneIsThatOfTheWholePicture) {
  const SplatView view = tests::SomeView(40, 30);
  const auto field = SomeField(tests::SomeSplats(40));
  const RenderedView whole = field->Render(view.camera, view.world_from_cam, {}),
                     depth = field->Render(view.camera, view.world_from_cam, {.depth_only = true});
  EXPECT_EQ(depth.depth, whole.depth);
  EXPECT_EQ(depth.median_depth, whole.median_depth);
  EXPECT_EQ(depth.opacity, whole.opacity);
}

// Of two splats on the optical axis, which the camera looks along from 3 before the origin, with a share of a
// half.
TEST(TrainedField, NearSplatsAreThoseWithinTheDistance) {
  const SplatView view = tests::SomeView(32, 24);
  Splats splats = tests::SomeSplats(2);
  for (std::size_t i = 0; i < 2; ++i) {
    const Eigen::Vector3d place = view.world_from_cam * Eigen::Vector3d(0, 0, i == 0 ? -1 : -3);
    for (std::size_t c = 0; c < 3; ++c) {
      splats.places[3 * i + c] = static_cast<float>(place[static_cast<int>(c)]);
      splats.log_scales[3 * i + c] = std::log(i == 0 ? 0.05f : 0.5f);
    }
    splats.opacities[i] = 3;  // 0.953
  }
  const auto field = SomeField(splats);
  const auto covered = [&](double distance) {
    double sum = 0;
    for (const float opacity : field->NearSplatOpacity(view.camera, view.world_from_cam, distance, 1)) {
      EXPECT_TRUE(opacity >= 0 && opacity <= 0.5f) << opacity;
      sum += static_cast<double>(opacity);
    }
    return sum;
  };
  EXPECT_EQ(covered(0.9), 0);
  // 2 pi sigma^2 pixels of a Gaussian, a little less for what lies below the least alpha.
  const double sigma = 0.05 * 1.1 * 32, near = 0.5 * 0.953 * 2 * M_PI * sigma * sigma;
  EXPECT_NEAR(covered(2), near, 0.2 * near);
  EXPECT_GT(covered(4), 2 * near);
}

}  // namespace
}  // namespace nerf
