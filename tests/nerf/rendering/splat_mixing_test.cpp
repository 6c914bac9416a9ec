// How the pictures of field and splats become one.
#include "nerf/rendering/splat_mixing.h"

#include <gtest/gtest.h>

#include "nerf/splatting/plain_rasteriser.h"
#include "tests/support/scenes/some_splats.h"

namespace nerf {
namespace {

class SplatMixing : public testing::Test {
 protected:
  SplatMixing()
      : scene_field_(SceneContraction{},
                     SamplerOptions{},
                     std::make_unique<HashField>(
                         HashFieldOptions{
                             .grid = {.log2_hashmap_size = 4, .base_resolution = 4, .finest_resolution = 16}},
                         1),
                     64),
        view_(tests::SomeView(24, 16)) {
    scene_field_.splat_focal_px = static_cast<float>(view_.camera.fl_x);
  }

  std::vector<float> Mixed() {
    std::vector<float> rgb(3 * 24 * 16, 0.25f);
    MixSplats(scene_field_, view_.camera, view_.world_from_cam, &workers_, &rgb);
    return rgb;
  }

  io::Workers workers_{2};
  SceneField scene_field_;
  const SplatView view_;
};

TEST_F(SplatMixing, IsAMeanOfTheFieldAndOfSplatsBeforeTheField) {
  scene_field_.splats = tests::SomeSplats(60);
  scene_field_.splat_share = 0.3f;
  const std::vector<double> over = RenderPlainly(scene_field_.splats, view_, {0.25, 0.25, 0.25});
  const std::vector<float> mixed = Mixed();
  double far_from_field = 0;
  for (std::size_t i = 0; i < mixed.size(); ++i) {
    EXPECT_NEAR(mixed[i], std::clamp(0.7 * 0.25 + 0.3 * over[i], 0.0, 1.0), 0.005);
    far_from_field = std::max(far_from_field, std::abs(static_cast<double>(mixed[i]) - 0.25));
  }
  EXPECT_GT(far_from_field, 0.06);
}

TEST_F(SplatMixing, WithoutSplatsItIsTheField) {
  for (const float value : Mixed()) EXPECT_EQ(value, 0.25f);
}

// Pictures that were fitted through pixels of one size look through them at every magnification.
TEST_F(SplatMixing, ALongerFocalLengthMagnifiesThePixelsOfTheFit) {
  io::Camera camera = view_.camera;
  EXPECT_NEAR(SplatViewOf(scene_field_, camera, view_.world_from_cam).low_pass, kLowPass, 1e-6);
  camera.fl_x *= 3, camera.fl_y *= 3;
  EXPECT_NEAR(SplatViewOf(scene_field_, camera, view_.world_from_cam).low_pass, 9 * kLowPass, 1e-4);
  camera.fl_x /= 30;
  EXPECT_NEAR(SplatViewOf(scene_field_, camera, view_.world_from_cam).low_pass, kLowPass, 1e-6);
}

}  // namespace
}  // namespace nerf
