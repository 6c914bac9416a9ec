// One shard of a training batch of the `hash` field: a fixed range of the batch's rays, marched, encoded,
// rendered and differentiated by one thread into buffers of its own.
#pragma once

#include <vector>

#include "nerf/fields/hash_grid.h"
#include "nerf/fields/hash_network.h"
#include "nerf/steps/camera_refinement.h"
#include "nerf/steps/pixel_gradients.h"

namespace nerf {

// What all shards of a batch share.
template <typename Real>
struct HashShardContext {
  const Dataset& dataset;
  const HashGrid& grid;
  const HashNetwork<Real>& network;
  const Sampler& sampler;
  const BatchPlan& plan;
  const CameraRefinement* refinement = nullptr;  // null: cameras stay as they are
};

// What a shard leaves for the optimiser.
template <typename Real>
struct HashShard {
  ShardSamples samples;
  // d loss / d features of the sorted samples by level: [n_levels][stride / 4][4].
  std::vector<Real> feature_gradients;
  std::size_t feature_gradient_stride = 0;  // values between levels
  std::vector<float> weight_gradients;
  std::vector<Vector6d> camera_gradients;  // [n_views], or empty: not looked at in this step
  ShardLoss loss;
};

// Scratch of one thread, reused.
template <typename Real>
struct HashShardScratch {
  RayBatch batch;
  KeptSamples kept;
  std::vector<Real> wave_features, kept_features, features;  // [n][32]: of a wave, as kept, and by ray
  PixelGradients pixels;
  NetworkRows<Real> rows;
  UnitGradients unit_gradients;
};

template <typename Real>
void RunHashShard(const HashShardContext<Real>& context,
                  int index,
                  HashShardScratch<Real>* scratch,
                  HashShard<Real>* shard);

}  // namespace nerf
