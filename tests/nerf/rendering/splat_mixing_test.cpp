// How the pictures of field and splats become one.
#include "nerf/rendering/splat_mixing.h"

#include <gtest/gtest.h>

#include <cmath>

#include "nerf/splatting/plain_rasteriser.h"
#include "tests/support/scenes/small_field.h"
#include "tests/support/scenes/some_splats.h"

namespace nerf {
namespace {

class SplatMixing : public testing::Test {
 protected:
  SplatMixing() : scene_field_(tests::SmallField()), view_(tests::SomeView(24, 16)) {
    scene_field_.splat_focal_px = static_cast<float>(view_.camera.fl_x);
  }

  // With a grey field.
  std::vector<float> Mixed(const std::optional<CropBox>& crop = {}, float opacity = 1) {
    RenderedView field{.width = 24, .height = 16};
    field.rgb.assign(3 * 24 * 16, 0.25f), field.opacity.assign(24 * 16, opacity);
    MixSplats(scene_field_, view_.camera, view_.world_from_cam, crop, &workers_, &field);
    return field.rgb;
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

TEST_F(SplatMixing, InACropBoxTheFieldsOpacityIsKept) {
  scene_field_.splats = tests::SomeSplats(60);
  const CropBox box{.size = {4, 4, 4}};  // all of them
  const std::vector<float> whole = Mixed(), opaque = Mixed(box, 1), half = Mixed(box, 0.5f),
                           none = Mixed(box, 0);
  EXPECT_EQ(opaque, whole);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(none[i], 0.25f);
    EXPECT_NEAR(half[i], 0.5 * (0.25 + whole[i]), 1e-6);
  }
  EXPECT_EQ(Mixed({}, 0), whole) << "without a box light that leaves the scene shows the background";
}

TEST_F(SplatMixing, WithoutSplatsItIsTheField) {
  for (const float value : Mixed()) EXPECT_EQ(value, 0.25f);
}

// The pixels that splats look through are as large in the scene for cameras of any focal length.
TEST_F(SplatMixing, FocalLengthsMagnifyThePixelsOfTheFit) {
  io::Camera camera = view_.camera;
  const auto low_pass = [&] { return SplatViewOf(scene_field_, camera, view_.world_from_cam).low_pass; };
  EXPECT_NEAR(low_pass(), kLowPass, 1e-6);
  camera.fl_x *= 3, camera.fl_y *= 3;
  EXPECT_NEAR(low_pass(), 9 * kLowPass, 1e-4);
  camera.fl_x /= 6, camera.fl_y /= 6;
  EXPECT_NEAR(low_pass(), kLowPass / 4, 1e-6);
}

double MeanDifference(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(static_cast<double>(a[i]) - b[i]);
  return sum / static_cast<double>(a.size());
}

// Splats look through the pixels of the pictures that they were fitted to: a picture of another size is that
// picture, magnified or shrunk.
TEST_F(SplatMixing, PicturesOfAllSizesAreThatOfTheFit) {
  scene_field_.splats = tests::SomeSplats(60);
  for (float& scale : scene_field_.splats.log_scales) scale -= 2;  // thinner than pixels
  SplatRasteriser rasteriser(&workers_);
  const SplatPicture fitted = rasteriser.Render(scene_field_.splats, view_);
  const auto picture_of = [&](int width, int height) {
    return RenderSplats(
        scene_field_, io::ResizedCamera(view_.camera, width, height), view_.world_from_cam, {}, &rasteriser);
  };
  EXPECT_EQ(picture_of(24, 16).rgb, fitted.rgb);

  // Means of 4 x 4 pixels. As if they were fitted to the small pictures, thin splats would cover more.
  const SplatPicture small = picture_of(6, 4);
  std::vector<float> means(small.rgb.size());
  for (std::size_t i = 0; i < fitted.rgb.size(); ++i) {
    const std::size_t x = i / 3 % 24 / 4, y = i / 72 / 4;
    means[3 * (6 * y + x) + i % 3] += fitted.rgb[i] / 16;
  }
  EXPECT_LT(MeanDifference(small.rgb, means), 1e-6);
  scene_field_.splat_focal_px /= 4;
  EXPECT_GT(MeanDifference(picture_of(6, 4).rgb, means), 0.01);

  // A pixel of three times the size is what the fit's pixel shows.
  scene_field_.splat_focal_px *= 4;
  const SplatPicture large = picture_of(72, 48);
  std::vector<float> middles;
  for (std::size_t i = 0; i < fitted.rgb.size(); ++i)
    middles.push_back(large.rgb[3 * (72 * (3 * (i / 72) + 1) + 3 * (i / 3 % 24) + 1) + i % 3]);
  EXPECT_LT(MeanDifference(middles, fitted.rgb), 0.002);
}

// A picture of a very wide angle stays small.
TEST_F(SplatMixing, AWideAngleIsShrunkFourTimesAtMost) {
  scene_field_.splats = tests::SomeSplats(60);
  scene_field_.splat_focal_px *= 1000;
  SplatRasteriser rasteriser(&workers_);
  EXPECT_EQ(
      RenderSplats(scene_field_, view_.camera, view_.world_from_cam, {}, &rasteriser).transmittance.size(),
      24u * 16u);
}

}  // namespace
}  // namespace nerf
