// How the pictures of field and splats become one.
#include "nerf/rendering/splat_mixing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

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

// A picture of 24 x 16 values whose pixels are the means of 2 x 2, magnified again: three quarters of a pixel
// and one quarter of its neighbour each way, or of itself at the edge.
std::vector<double> Blurred(const std::vector<double>& picture) {
  const auto mean = [&](int x, int y) {
    x = std::clamp(x, 0, 11), y = std::clamp(y, 0, 7);
    const auto at = [&](int dx, int dy) {
      return picture[static_cast<std::size_t>(24 * (2 * y + dy) + 2 * x + dx)];
    };
    return (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) / 4;
  };
  std::vector<double> blurred;
  for (int i = 0; i < 24 * 16; ++i) {
    const int x = i % 24 / 2, y = i / 24 / 2, beside_x = x + (i % 2 ? 1 : -1),
              beside_y = y + (i / 24 % 2 ? 1 : -1);
    blurred.push_back(9 * mean(x, y) / 16 + 3 * (mean(beside_x, y) + mean(x, beside_y)) / 16 +
                      mean(beside_x, beside_y) / 16);
  }
  return blurred;
}

TEST_F(SplatMixing, ASmallFieldHasTheFineStructureOfTheSplats) {
  scene_field_.splats = tests::SomeSplats(60);
  for (float& scale : scene_field_.splats.log_scales) scale -= 1;  // about as wide as pixels
  scene_field_.splat_share = 0.3f;
  const std::vector<double> over = RenderPlainly(scene_field_.splats, view_, {0.25, 0.25, 0.25});
  RenderedView field{.width = 12, .height = 8};
  field.rgb.assign(3 * 12 * 8, 0.25f), field.opacity.assign(12 * 8, 1);
  MixSplats(scene_field_, view_.camera, view_.world_from_cam, {}, &workers_, &field);
  ASSERT_EQ(field.width, 24);
  double most = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<double> channel;
    for (std::size_t i = c; i < over.size(); i += 3) channel.push_back(over[i]);
    const std::vector<double> blurred = Blurred(channel);
    for (std::size_t i = 0; i < channel.size(); ++i) {
      const double detail = channel[i] - blurred[i], whole = 0.25 + detail;
      EXPECT_NEAR(field.rgb[3 * i + c], std::clamp(whole + 0.3 * (channel[i] - whole), 0.0, 1.0), 0.006);
      most = std::max(most, std::abs(detail));
    }
  }
  EXPECT_GT(most, 0.06);
}

TEST_F(SplatMixing, WhereABoxIsEmptyASmallFieldStaysAsItIs) {
  scene_field_.splats = tests::SomeSplats(60);
  RenderedView field{.width = 12, .height = 8};
  field.rgb.assign(3 * 12 * 8, 0.25f), field.opacity.assign(12 * 8, 0);
  MixSplats(scene_field_, view_.camera, view_.world_from_cam, CropBox{.size = {4, 4, 4}}, &workers_, &field);
  for (const float value : field.rgb) EXPECT_EQ(value, 0.25f);
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

// The splats lie some units from the camera; the field has the same everywhere, nearer or farther.
TEST_F(SplatMixing, WhatStandsBeforeTheSplatsGivesWayToThem) {
  scene_field_.splats = tests::SomeSplats(60);
  scene_field_.splat_share = 0.3f, scene_field_.splat_share_behind = 1;
  const std::vector<double> over = RenderPlainly(scene_field_.splats, view_, {0.25, 0.25, 0.25});
  const auto expect_share = [&](double share, float depth, int width, int height) {
    RenderedView field{.width = width, .height = height};
    const auto n = static_cast<std::size_t>(width * height);
    field.rgb.assign(3 * n, 0.25f), field.opacity.assign(n, 1), field.median_depth.assign(n, depth);
    MixSplats(scene_field_, view_.camera, view_.world_from_cam, {}, &workers_, &field);
    double sum = 0, difference = 0;
    for (std::size_t i = 0; i < over.size(); ++i) {
      sum += std::abs(std::clamp(over[i], 0.0, 1.0) - 0.25);
      difference += std::abs(field.rgb[i] - std::clamp(0.25 + share * (over[i] - 0.25), 0.0, 1.0));
    }
    EXPECT_LT(difference, 0.03 * sum) << "field at " << depth;
  };
  expect_share(1, 0.1f, 24, 16);
  expect_share(0.3, 100, 24, 16);
  expect_share(0.3, std::numeric_limits<float>::infinity(), 24, 16);
  scene_field_.splat_share_behind = 0.7f;
  expect_share(0.7, 0.1f, 24, 16);
  scene_field_.splat_share_behind = 0.2f;
  expect_share(0.3, 0.1f, 24, 16);
}

// The left half of the scene, as the camera sees it, is the splats', the right one the field's.
TEST_F(SplatMixing, SharesAreThoseOfTheSurfacesPlace) {
  scene_field_.splats = tests::SomeSplats(60);
  scene_field_.splat_share = 0.3f;
  scene_field_.splat_shares.cells.assign(ShareMap::kCells, 0);
  const RayCamera camera(view_.camera, view_.world_from_cam);
  constexpr float kDepth = 1, kNothing = std::numeric_limits<float>::infinity();
  for (int x = 0; x < 12; ++x) {
    for (int y = 0; y < 16; ++y) {
      const auto place = PlaceOfSurface(scene_field_.contraction, camera.RayThrough(x, y), kDepth);
      // And the cells around it, which the shares between their middles depend on.
      for (int beside = 0; beside < 27; ++beside) {
        UnitPlace cell = *place;
        for (std::size_t axis = 0, left = static_cast<std::size_t>(beside); axis < 3; ++axis, left /= 3)
          cell[axis] += (static_cast<float>(left % 3) - 1) / ShareMap::kResolution;
        scene_field_.splat_shares.cells[ShareMap::CellAt(cell)] = 255;
      }
    }
  }
  const auto mixed_at = [&](float depth) {
    RenderedView field{.width = 24, .height = 16};
    field.rgb.assign(3 * 24 * 16, 0.25f), field.opacity.assign(24 * 16, 1);
    field.median_depth.assign(24 * 16, depth);
    MixSplats(scene_field_, view_.camera, view_.world_from_cam, {}, &workers_, &field);
    return field.rgb;
  };
  const std::vector<float> by_place = mixed_at(kDepth), nowhere = mixed_at(kNothing);
  scene_field_.splat_shares = {};
  EXPECT_EQ(nowhere, mixed_at(kDepth));
  EXPECT_EQ(nowhere, Mixed());
  scene_field_.splat_share = 1;
  const std::vector<float> splats = Mixed();
  EXPECT_NE(splats, nowhere);
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const std::size_t x = i / 3 % 24;
    if (x == 12 || x == 13) continue;  // between the middles of cells of both halves
    EXPECT_NEAR(by_place[i], x < 12 ? splats[i] : 0.25f, 1e-5) << i;
  }
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
