// Waves of a training batch: which samples are kept, and when a ray ends.
#include "nerf/steps/ray_batch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace nerf {
namespace {

// A batch of one ray with one wave of samples of unit interval.
RayBatch OneWave(int n) {
  RayBatch batch;
  batch.rays.emplace_back();
  batch.wave_ray = {0};
  batch.wave_first = {0, n};
  batch.wave.delta.assign(static_cast<std::size_t>(n), 1.f);
  return batch;
}

std::vector<std::size_t> Kept(const BatchPlan& plan, const std::vector<float>& sigma, RayBatch* batch) {
  std::vector<std::size_t> kept;
  EndWave(plan, sigma.data(), batch, [&](int ray, std::size_t i) {
    EXPECT_EQ(ray, 0);
    kept.push_back(i);
  });
  EXPECT_EQ(batch->rays[0].n_kept, static_cast<int>(kept.size()));
  return kept;
}

// A view of 4 x 4 pixels along -z from the origin, whose image plane is in pixels.
Dataset OneView() {
  io::Camera camera;
  camera.width = camera.height = 4;
  camera.fl_x = camera.fl_y = 1, camera.cx = camera.cy = 2;
  Dataset dataset;
  dataset.views.push_back({"view", RayCamera(camera, io::Rigid3d()), 4, 4, 0});
  for (int p = 0; p < 16; ++p) dataset.pixels.insert(dataset.pixels.end(), 3, static_cast<std::uint8_t>(p));
  return dataset;
}

// Where a ray meets the image plane, pixels.
std::array<float, 2> ImagePoint(const Ray& ray) {
  return {2 - ray.direction[0] / ray.direction[2], 2 + ray.direction[1] / ray.direction[2]};
}

TEST(DrawRays, PixelsWithBackgroundInThemAreComparedOnIt) {
  Dataset dataset = OneView();
  const std::vector<std::uint8_t> rgb = dataset.pixels;
  dataset.channels = 4;
  dataset.background = {0.25f, 0.5f, 0.75f};
  dataset.pixels.clear();
  for (std::size_t p = 0; p < 16; ++p) {  // alpha 0, 128, 255, 0, ...
    dataset.pixels.insert(dataset.pixels.end(), &rgb[3 * p], &rgb[3 * p] + 3);
    dataset.pixels.push_back(static_cast<std::uint8_t>((p % 3 * 255 + 1) / 2));
  }
  const SceneContraction contraction{{0, 0, 0}, 10, false};
  const OccupancyGrid grid(64, contraction);
  const Sampler sampler({.near = 0.1f, .far = 5, .step_size = 0.1f}, contraction, grid);
  RayBatch batch;
  DrawRays(dataset, sampler, {.seed = 1, .n_rays = 200, .n_shards = 1}, 0, &batch);
  int seen[3] = {};
  for (const BatchRay& ray : batch.rays) {
    const auto at = ImagePoint(ray.ray);
    const auto p = static_cast<int>(at[1]) * 4 + static_cast<int>(at[0]);
    ++seen[p % 3];
    EXPECT_EQ(ray.target.background, p % 3 == 1 ? dataset.background->data() : nullptr);
    EXPECT_EQ(ray.target.alpha, p % 3 == 0 ? 0.f : 1.f);
    EXPECT_EQ(ray.target.premultiplied[0], p % 3 == 0 ? 0.f : static_cast<float>(p) / 255.f);
  }
  for (const int n : seen) EXPECT_GT(n, 30);
}

TEST(DrawRays, RaysOfAPixelAreRandomInTheCellsOfItsLattice) {
  const Dataset dataset = OneView();
  const SceneContraction contraction{{0, 0, 0}, 10, false};
  const OccupancyGrid grid(64, contraction);
  const Sampler sampler({.near = 0.1f, .far = 5, .step_size = 0.1f}, contraction, grid);
  for (const int samples_per_pixel : {1, 4, 9}) {
    const int side = samples_per_pixel == 9 ? 3 : samples_per_pixel == 4 ? 2 : 1, n_pixels = 100;
    RayBatch batch;
    std::vector<BatchRay> rays;
    for (int shard = 0; shard < 3; ++shard) {
      const BatchPlan plan{.seed = 1,
                           .n_rays = n_pixels * samples_per_pixel,
                           .samples_per_pixel = samples_per_pixel,
                           .n_shards = 3};
      DrawRays(dataset, sampler, plan, shard, &batch);
      ASSERT_EQ(batch.rays.size() % static_cast<std::size_t>(samples_per_pixel), 0u);
      rays.insert(rays.end(), batch.rays.begin(), batch.rays.end());
    }
    ASSERT_EQ(rays.size(), static_cast<std::size_t>(n_pixels * samples_per_pixel));
    double spread = 0;
    for (std::size_t r = 0; r < rays.size(); ++r) {
      EXPECT_EQ(rays[r].id, r);
      const int pixel = static_cast<int>(std::lround(rays[r].target.premultiplied[0] * 255));
      const auto [x, y] = ImagePoint(rays[r].ray);
      const int k = static_cast<int>(r) % samples_per_pixel;
      const float u = (x - static_cast<float>(pixel % 4)) * static_cast<float>(side) -
                      static_cast<float>(k % side),
                  v = (y - static_cast<float>(pixel / 4)) * static_cast<float>(side) -
                      static_cast<float>(k / side);
      EXPECT_TRUE(u > -1e-4f && u < 1.0001f && v > -1e-4f && v < 1.0001f)
          << samples_per_pixel << ": " << u << " " << v;
      spread += std::fabs(double{u} - 0.5) + std::fabs(double{v} - 0.5);
    }
    spread /= 2.0 * static_cast<double>(rays.size());
    EXPECT_NEAR(spread, samples_per_pixel == 1 ? 0 : 0.25, 0.03)
        << "one ray is in the centre, several are random";
  }
}

TEST(DrawRays, RaysOfAPixelStartStaggeredWithinTheirFirstInterval) {
  const Dataset dataset = OneView();
  const SceneContraction contraction{{0, 0, 0}, 10, false};
  const OccupancyGrid grid(64, contraction);
  const Sampler sampler({.near = 0.1f, .far = 5, .step_size = 0.1f}, contraction, grid);
  for (const int samples_per_pixel : {1, 4}) {
    RayBatch batch;
    DrawRays(dataset,
             sampler,
             {.seed = 1, .n_rays = 400, .samples_per_pixel = samples_per_pixel, .n_shards = 1},
             0,
             &batch);
    ASSERT_EQ(batch.rays.size(), 400u);
    double mean = 0;
    for (std::size_t first = 0; first < batch.rays.size();
         first += static_cast<std::size_t>(samples_per_pixel)) {
      std::vector<double> offsets;
      for (std::size_t r = first; r < first + static_cast<std::size_t>(samples_per_pixel); ++r) {
        float begin, end;
        sampler.Range(batch.rays[r].ray, &begin, &end);
        offsets.push_back((batch.rays[r].t - begin) / 0.1);
        mean += offsets.back() / 400;
      }
      std::sort(offsets.begin(), offsets.end());
      EXPECT_GE(offsets.front(), -1e-5);
      EXPECT_LT(offsets.back(), 1 + 1e-5);
      for (std::size_t k = 1; k < offsets.size(); ++k)
        EXPECT_NEAR(offsets[k] - offsets[k - 1], 1.0 / samples_per_pixel, 1e-5);
    }
    EXPECT_NEAR(mean, 0.5, 0.05);
  }
}

TEST(DrawRays, AShareGoesThroughSparsePoints) {
  Dataset dataset = OneView();
  dataset.depths = {{.view = 0, .point = 0, .x = 2.25f, .y = 1.75f, .t = 3}};
  const SceneContraction contraction{{0, 0, 0}, 10, false};
  const OccupancyGrid grid(64, contraction);
  const Sampler sampler({.near = 0.1f, .far = 5, .step_size = 0.1f}, contraction, grid);
  RayBatch batch;
  BatchPlan plan{.seed = 1, .n_rays = 1000, .n_shards = 1, .depth_share = 0.25f};
  DrawRays(dataset, sampler, plan, 0, &batch);
  int n_depths = 0;
  for (const BatchRay& ray : batch.rays) {
    if (ray.depth == 0) continue;
    ++n_depths;
    EXPECT_EQ(ray.depth, 3);
    EXPECT_NEAR(ImagePoint(ray.ray)[0], 2.25, 1e-5);
    EXPECT_NEAR(ImagePoint(ray.ray)[1], 1.75, 1e-5);
    EXPECT_EQ(ray.target.premultiplied[0], 6 / 255.f) << "pixel (2, 1)";
  }
  EXPECT_NEAR(n_depths, 250, 50);
  dataset.depths.clear();
  DrawRays(dataset, sampler, plan, 0, &batch);
  for (const BatchRay& ray : batch.rays) EXPECT_EQ(ray.depth, 0);
}

TEST(WaveAtInfinity, HasOneSampleForEachRayWithLight) {
  RayBatch batch;
  batch.rays.resize(3);
  for (BatchRay& ray : batch.rays) ray.ray = {{1, 2, 3}, {0, 0, -1}};
  batch.rays[1].optical_depth = 5;
  batch.rays[2].optical_depth = std::numeric_limits<float>::quiet_NaN();
  const SceneContraction contraction{{0, 0, 0}, 1, true};
  const OccupancyGrid grid(64, contraction);
  const Sampler sampler({}, contraction, grid);
  WaveAtInfinity(sampler, {.early_stop_depth = 4}, &batch);
  EXPECT_EQ(batch.wave_ray, (std::vector<int>{0, 2})) << "what is not finite is kept for the loss to find";
  ASSERT_EQ(batch.wave.size(), 2);
  EXPECT_EQ(batch.wave.t[0], std::numeric_limits<float>::infinity());
  EXPECT_EQ(batch.wave.x[0], 0.5f);
  EXPECT_EQ(batch.wave.y[0], 0.5f);
  EXPECT_EQ(batch.wave.z[0], 0.f);
}

TEST(EndWave, DropsWhatCarriesLessWeightThanTheLeast) {
  // Weights 1e-5, about 0.63, 1e-5 e^-1, 0.37 (1 - e^-0.5).
  const std::vector<float> sigma = {1e-5f, 1.f, 1e-5f, 0.5f};
  RayBatch batch = OneWave(4);
  EXPECT_EQ(Kept({.min_weight = 1e-4f}, sigma, &batch), (std::vector<std::size_t>{1, 3}));
  EXPECT_NEAR(batch.rays[0].optical_depth, 1.50002, 1e-5) << "dropped samples absorb all the same";
  EXPECT_NEAR(batch.rays[0].transmittance, std::exp(-1.50002), 1e-5);
  batch = OneWave(4);
  EXPECT_EQ(Kept({.min_weight = 0}, sigma, &batch).size(), 4u);
}

TEST(EndWave, WeightCountsTheLightThatIsLeftFromWaveToWave) {
  RayBatch batch = OneWave(1);
  const BatchPlan plan{.early_stop_depth = 9, .min_weight = 1e-3f};
  EXPECT_EQ(Kept(plan, {2e-3f}, &batch).size(), 1u);
  batch.rays[0].n_kept = 0;
  EXPECT_EQ(Kept(plan, {4.f}, &batch).size(), 1u);
  batch.rays[0].n_kept = 0;
  EXPECT_EQ(Kept(plan, {2e-3f}, &batch).size(), 0u) << "behind an optical depth of 4 it weighs 4e-5";
}

TEST(EndWave, RayEndsWithTheSampleThatMakesItOpaque) {
  RayBatch batch = OneWave(4);
  EXPECT_EQ(Kept({.early_stop_depth = 4.6f}, {1, 4, 1, 1}, &batch), (std::vector<std::size_t>{0, 1}));
  EXPECT_FALSE(batch.rays[0].marching);
}

TEST(EndWave, KeepsNaNForTheLossToFind) {
  RayBatch batch = OneWave(2);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(Kept({.min_weight = 1e-4f}, {nan, 1.f}, &batch).size(), 2u);
}

TEST(FullGradientDistance, IsTwoOrWhereATwentiethOfTheDepthsIsNearer) {
  Dataset dataset;
  EXPECT_EQ(FullGradientDistance(dataset), 2.f);
  for (int i = 0; i < 101; ++i)
    dataset.depths.push_back({.view = 0, .point = 0, .x = 0, .y = 0, .t = 1 + 0.1f * static_cast<float>(i)});
  EXPECT_FLOAT_EQ(FullGradientDistance(dataset), 1.5f);
  for (SparseDepth& depth : dataset.depths) depth.t += 2;
  EXPECT_EQ(FullGradientDistance(dataset), 2.f);
}

}  // namespace
}  // namespace nerf
