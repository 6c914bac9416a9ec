// One shard of a training batch of the `hash` field: a fixed range of the batch's rays, marched, encoded,
// rendered and differentiated by one thread into buffers of its own.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/fields/hash_grid.h"
#include "nerf/fields/hash_network.h"
#include "nerf/training/ray_batch.h"

namespace nerf {

template <typename Real>
struct ShardResult {
  // Samples whose weight counts, in ray order, and d loss / d features by level: [n_levels][stride / 4][4].
  Samples samples;
  std::vector<Real> feature_gradients;
  std::size_t feature_gradient_stride = 0;  // values between levels
  std::vector<float> weight_gradients;
  // Every marched sample, for the occupancy grid.
  std::vector<std::uint32_t> visited_cell;
  std::vector<float> visited_sigma;

  double loss = 0, squared_error = 0, opacity = 0;  // sums over pixels
  bool finite = true;
  std::uint64_t first_bad_ray = 0;  // valid when !finite
};

// Scratch of one thread, reused.
template <typename Real>
struct ShardScratch {
  RayBatch batch;
  Samples kept;  // in the order they were kept
  std::vector<int> kept_ray;
  std::vector<Real> wave_features, kept_features, features;  // [n][32]: of a wave, as kept, and in ray order
  std::vector<float> wave_sigma, t, delta, tau, weights, logit_gradients, log_sigma_gradients;
  std::vector<float> places, lengths, distortion_gradients;  // of one ray, see distortion.h
  NetworkRows<Real> rows;
};

template <typename Real>
void TrainShard(const Dataset& dataset,
                const HashGrid& grid,
                const HashNetwork<Real>& network,
                const Sampler& sampler,
                const BatchPlan& plan,
                int shard,
                ShardScratch<Real>* scratch,
                ShardResult<Real>* result);

}  // namespace nerf
