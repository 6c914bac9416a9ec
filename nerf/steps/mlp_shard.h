// One shard of a training batch of the `nerf` field: a fixed range of the batch's rays, sampled, and
// differentiated chunk by chunk through the network by one thread, into buffers of its own.
#pragma once

#include <vector>

#include "nerf/fields/mlp_field.h"
#include "nerf/steps/pixel_gradients.h"

namespace nerf {

// What all shards of a batch share.
struct MlpShardContext {
  const Dataset& dataset;
  const MlpField& field;
  const Sampler& sampler;
  const BatchPlan& plan;
};

struct MlpShard {
  ShardSamples samples;                // of the last pass
  ShardLoss loss;                      // squared error and opacity: of the last pass alone
  std::uint64_t n_differentiated = 0;  // samples, of all passes
  std::vector<float> gradients;        // of all networks

  // Scratch, reused.
  RayBatch batch;
  KeptSamples kept;
  std::vector<std::vector<float>> t;  // without grid: distances per ray
  std::vector<float> position_codes, direction_codes, ray_codes, delta, rgb;
  PixelGradients pixels;
};

// Throws io::Interrupted between chunks.
void RunMlpShard(const MlpShardContext& context, int index, MlpShard* shard);

}  // namespace nerf
