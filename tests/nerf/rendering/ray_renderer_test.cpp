// Rendered rays of a field that is known in closed form: a grey fog, or nothing.
#include "nerf/rendering/ray_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "nerf/rendering/volume_rendering.h"
#include "tests/support/scenes/field_tensor.h"

namespace nerf {
namespace {

// A field without weights is a fog of exp(-1) per unit and of colour 0.5 everywhere.
class RayRenderer : public testing::Test {
 protected:
  RayRenderer()
      : fog_({{0, 0, 0}, 50, false},
             {.near = 0, .far = 1000, .step_size = 0.1f},
             std::make_unique<HashField>(
                 HashFieldOptions{
                     {.n_levels = 8, .log2_hashmap_size = 8, .base_resolution = 3, .finest_resolution = 40}},
                 1),
             64) {
    SetWeights(HashNetwork<float>::kEnd, 0.f);
  }

  void Fill() {
    for (std::uint32_t cell = 0; cell < fog_.grid.n_cells(); ++cell) fog_.grid.SetCandidate(cell);
    fog_.grid.Rebuild();
  }

  // The first n weights, to where some layer begins.
  void SetWeights(std::size_t n, float value) {
    const std::span<float> first = tests::TensorOf(fog_.field.get(), "weights").first(n);
    std::fill(first.begin(), first.end(), value);
    fog_.field->Refresh();
  }

  RenderedRay RenderAlong(const Ray& ray, float step_scale = 1.f) {
    io::Workers workers(1);
    return RenderRays(fog_, {&ray, 1}, 1, step_scale, &workers)[0];
  }

  SceneField fog_;
};

TEST_F(RayRenderer, RayEndsAtFarOrWhereItIsOpaqueAndIsNotRenormalised) {
  Fill();
  for (const float length : {1.f, 5.f, 20.f, 80.f}) {
    const RenderedRay ray = RenderAlong({{0, 0, 50 - length}, {0, 0, 1}});
    const double exact = std::exp(-length * std::exp(-1.0));
    // The last interval may reach over the end of the ray by its length, 0.1.
    EXPECT_NEAR(ray.transmittance, exact, 0.04 * exact + kEarlyStopTransmittance) << length;
    EXPECT_GT(ray.transmittance, 0.f);
    for (const float c : ray.rgb) EXPECT_NEAR(c, 0.5f * (1 - ray.transmittance), 1e-6 * length + 1e-6);
  }
  const float stopped = RenderAlong({{0, 0, -30}, {0, 0, 1}}).transmittance;
  EXPECT_LT(stopped, kEarlyStopTransmittance);
  EXPECT_GT(stopped, 0.5f * kEarlyStopTransmittance) << "the wave after the stop was still followed";
}

TEST_F(RayRenderer, MedianDepthIsWhereHalfTheLightIsAbsorbed) {
  Fill();
  const double exact = std::log(2.0) / std::exp(-1.0);
  // It does not depend on where the samples lie.
  for (const float step_scale : {0.3f, 1.f, 7.f})
    EXPECT_NEAR(RenderAlong({{0, 0, 0}, {0, 0, 1}}, step_scale).median_depth, exact, 1e-4) << step_scale;
  EXPECT_TRUE(std::isinf(RenderAlong({{0, 0, 49}, {0, 0, 1}}).median_depth));
}

TEST_F(RayRenderer, DepthsAloneAreThoseOfTheWholePicture) {
  Fill();
  io::Workers workers(1);
  std::vector<Ray> rays;
  for (const float from : {-30.f, 0.f, 47.f, 49.9f, 60.f}) rays.push_back({{0, 0, from}, {0, 0, 1}});
  const std::vector<RenderedRay> whole = RenderRays(fog_, rays, 1, 1.f, &workers),
                                 depths = RenderRays(fog_, rays, 1, 1.f, &workers, {}, RayValues::kDepths);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(depths[i].transmittance, whole[i].transmittance) << i;
    EXPECT_EQ(depths[i].depth, whole[i].depth) << i;
    EXPECT_EQ(depths[i].median_depth, whole[i].median_depth) << i;
    for (const float c : depths[i].rgb) EXPECT_EQ(c, 0.f) << i;
  }
  EXPECT_GT(whole[0].rgb[0], 0.4f);
}

// Of training, samples reached the half with z < 0; the next cell is trained by that, the one behind it near.
TEST_F(RayRenderer, LightFromWhereNothingWasLearntIsTold) {
  Fill();
  constexpr std::size_t kCells = TrainedCells::kResolution;
  Samples samples;
  samples.resize(kCells * kCells * kCells / 2);
  for (std::size_t i = 0; i < samples.x.size(); ++i) {
    const auto middle = [](std::size_t cell) { return (static_cast<float>(cell) + 0.5f) / kCells; };
    samples.x[i] = middle(i % kCells), samples.y[i] = middle(i / kCells % kCells);
    samples.z[i] = middle(i / kCells / kCells);
  }
  auto& trained = dynamic_cast<HashField&>(*fog_.field).trained_cells();
  EXPECT_EQ(RenderAlong({{0, 0, -2}, {0, 0, 1}}).unlearnt, 0) << "as long as nothing is marked";
  trained.Mark(samples, 1);
  trained.Refresh();
  const RenderedRay ray = RenderAlong({{0, 0, -2}, {0, 0, 1}}, 0.1f);
  const double cell = 100.0 / kCells;
  EXPECT_NEAR(ray.unlearnt, std::exp(-(2 + 2 * cell) * std::exp(-1.0)) - ray.transmittance, 0.005);
  EXPECT_EQ(RenderAlong({{0, 0, -2}, {0, 0, -1}}).unlearnt, 0);
}

// Seen from a corner of the cube, pixels are means over rays of different lengths through fog.
TEST_F(RayRenderer, PixelsAreTheMeansOfTheirRays) {
  Fill();
  io::Camera camera;
  camera.width = camera.height = 2;
  camera.fl_x = camera.fl_y = 1, camera.cx = camera.cy = 1;
  io::Rigid3d world_from_cam;
  world_from_cam.translation = {48, 48, -47};
  const RayCamera ray_camera(camera, world_from_cam);
  const std::vector<CameraPixel> pixels = {{&ray_camera, 0, 0}, {&ray_camera, 1, 1}};
  io::Workers workers(1);
  for (const int n : {1, 4}) {
    const std::vector<RenderedRay> rendered = RenderPixels(fog_, pixels, n, 1.f, &workers);
    ASSERT_EQ(rendered.size(), pixels.size());
    for (std::size_t p = 0; p < pixels.size(); ++p) {
      double transmittance = 0, depth = 0, red = 0;
      std::vector<Ray> rays;
      for (const float dy : n == 1 ? std::vector<float>{0} : std::vector<float>{-0.25f, 0.25f}) {
        for (const float dx : n == 1 ? std::vector<float>{0} : std::vector<float>{-0.25f, 0.25f})
          rays.push_back(ray_camera.RayThrough(pixels[p].x, pixels[p].y, dx, dy));
      }
      for (const RenderedRay& ray : RenderRays(fog_, rays, n, 1.f, &workers))
        transmittance += ray.transmittance / n, depth += ray.depth / n, red += ray.rgb[0] / n;
      EXPECT_NEAR(rendered[p].transmittance, transmittance, 1e-6);
      EXPECT_NEAR(rendered[p].depth, depth, 1e-5 * depth);
      EXPECT_NEAR(rendered[p].rgb[0], red, 1e-6);
      EXPECT_GT(transmittance, 0.01);
      EXPECT_LT(transmittance, 0.99);
    }
  }
}

// Four rays that start a quarter of an interval apart sample the fog like one of intervals a quarter as long:
// sum over k < 4 of ceil(x - k / 4) = ceil(4 x).
TEST_F(RayRenderer, TheRaysOfAPixelAreStaggered) {
  Fill();
  io::Workers workers(1);
  for (const float length : {0.031f, 0.512f, 0.537f, 0.561f, 2.086f}) {
    const std::vector<Ray> rays(4, Ray{{0, 0, 50 - length}, {0, 0, 1}});
    double depth = 0;
    for (const RenderedRay& ray : RenderRays(fog_, rays, 4, 1.f, &workers))
      depth -= std::log(double{ray.transmittance}) / 4;
    EXPECT_NEAR(depth, -std::log(double{RenderAlong(rays[0], 0.25f).transmittance}), 2e-6) << length;
  }
  // However many rays are given at once, each has its place in its own pixel.
  const std::vector<RenderedRay> many =
      RenderRays(fog_, std::vector<Ray>(630, {{0, 0, 49}, {0, 0, 1}}), 9, 1.f, &workers);
  for (std::size_t i = 9; i < many.size(); ++i) ASSERT_EQ(many[i].depth, many[i % 9].depth) << i;
  EXPECT_NE(many[1].depth, many[0].depth);
}

// A ray through a unit of fog in 500 samples of less weight than any that gets a colour alone.
TEST_F(RayRenderer, ManySamplesOfLittleWeightKeepTheirColour) {
  Fill();
  const RenderedRay ray = RenderAlong({{0, 0, 49}, {0, 0, 1}}, 0.02f);
  EXPECT_NEAR(ray.transmittance, std::exp(-std::exp(-1.0)), 1e-3);
  for (const float c : ray.rgb) EXPECT_NEAR(c, 0.5f * (1 - ray.transmittance), 1e-5);
}

// No division by an opacity of 0.
TEST_F(RayRenderer, EmptySpaceShowsExactlyTheBackgroundAtTheEndOfTheRay) {
  fog_.grid.Rebuild();
  const RenderedRay inside = RenderAlong({{0, 0, -100}, {0, 0, 1}}),
                    past = RenderAlong({{0, 0, 60}, {0, 0, 1}});
  for (const RenderedRay& ray : {inside, past}) {
    EXPECT_EQ(ray.transmittance, 1.f);
    for (const float c : ray.rgb) EXPECT_EQ(c, 0.f);
    EXPECT_TRUE(std::isfinite(ray.depth));
  }
  EXPECT_EQ(inside.depth, 150.f);
}

TEST_F(RayRenderer, UnboundedRaysShowTheFieldAtInfinityBehindWhatTheyPass) {
  SceneField fog({{0, 0, 0}, 1, true},
                 {.near = 0, .far = 2, .step_size = 0.01f},
                 std::make_unique<HashField>(HashFieldOptions{}, 1),
                 64);
  const std::span<float> weights = tests::TensorOf(fog.field.get(), "weights");
  std::fill(weights.begin(), weights.end(), 0.f);
  fog.field->Refresh();
  ASSERT_TRUE(fog.EndsAtInfinity());
  EXPECT_EQ(fog.Background(false, {1, 1, 1}), (std::array<float, 3>{0, 0, 0}));
  const Ray ray = {{0, 0, 0}, {0, 0, 1}};
  io::Workers workers(1);
  for (const bool full : {false, true}) {
    if (full) {
      for (std::uint32_t cell = 0; cell < fog.grid.n_cells(); ++cell) fog.grid.SetCandidate(cell);
      fog.grid.Rebuild();
    }
    const double passes = full ? std::exp(-2 * std::exp(-1.0)) : 1;
    const RenderedRay seen = RenderRays(fog, {&ray, 1}, 1, 1.f, &workers)[0];
    EXPECT_NEAR(seen.transmittance, passes, 0.01) << "what infinity shows still counts as light that leaves";
    for (const float c : seen.rgb) EXPECT_NEAR(c, 0.5, 1e-5) << "all light has the colour 0.5";
    const RenderedRay ended = RenderRays(fog, {&ray, 1}, 1, 1.f, &workers, {.end = 5})[0];
    for (const float c : ended.rgb) EXPECT_NEAR(c, 0.5 * (1 - passes), 0.01) << "it ended before infinity";
    const RenderedRay depth = RenderRays(fog, {&ray, 1}, 1, 1.f, &workers, {}, RayValues::kDepths)[0];
    EXPECT_EQ(depth.transmittance, seen.transmittance);
    for (const float c : depth.rgb) EXPECT_EQ(c, 0.f);
  }
}

TEST_F(RayRenderer, OnlyWhatLiesInTheCropBoxIsShown) {
  Fill();
  const Ray ray = {{0, 0, -100}, {0, 0, 1}};
  io::Workers workers(1);
  const RenderedRay whole = RenderRays(fog_, {&ray, 1}, 1, 1.f, &workers)[0];
  RayLimits limits{.crop = CropBox{}};
  limits.crop->size = {2, 2, 10};
  limits.crop->world_from_box.translation = {0, 0, 10};
  const RenderedRay inside = RenderRays(fog_, {&ray, 1}, 1, 0.02f, &workers, limits)[0];
  EXPECT_NEAR(std::log(inside.transmittance), -10 * std::exp(-1.0), 0.01);
  EXPECT_GT(inside.transmittance, whole.transmittance);
  limits.crop->world_from_box.translation = {2, 0, 10};  // the ray passes beside it
  const RenderedRay beside = RenderRays(fog_, {&ray, 1}, 1, 1.f, &workers, limits)[0];
  EXPECT_EQ(beside.transmittance, 1.f);
  for (const float c : beside.rgb) EXPECT_EQ(c, 0.f);
}

// The first layer's ReLU and the limit of the exponent must not turn a NaN into a number.
TEST_F(RayRenderer, NotANumberInTheFirstLayerReachesEveryOutput) {
  Fill();
  SetWeights(HashNetwork<float>::kEnd, 0.01f);
  ASSERT_TRUE(std::isfinite(RenderAlong({{0, 0, 49}, {0, 0, 1}}).transmittance));
  SetWeights(HashNetwork<float>::kW2, std::numeric_limits<float>::quiet_NaN());
  const RenderedRay ray = RenderAlong({{0, 0, 49}, {0, 0, 1}});
  EXPECT_TRUE(std::isnan(ray.transmittance));
  for (const float c : ray.rgb) EXPECT_TRUE(std::isnan(c));
}

}  // namespace
}  // namespace nerf
