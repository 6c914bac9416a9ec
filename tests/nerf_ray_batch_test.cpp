// Waves of a training batch: which samples are kept, and when a ray ends.
#include "nerf/ray_batch.h"

#include <gtest/gtest.h>

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

// N27
TEST(EndWave, KeepsNaNForTheLossToFind) {
  RayBatch batch = OneWave(2);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(Kept({.min_weight = 1e-4f}, {nan, 1.f}, &batch).size(), 2u);
}

}  // namespace
}  // namespace nerf
