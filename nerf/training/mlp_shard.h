// One shard of a training batch of the `nerf` field: a fixed range of the batch's rays, sampled, and
// differentiated chunk by chunk through the network by one thread, into buffers of its own.
#pragma once

#include <string>
#include <vector>

#include "nerf/fields/scene_field.h"
#include "nerf/training/ray_batch.h"

namespace nerf {

struct MlpShard {
  double loss = 0, squared_error = 0, opacity = 0;    // sums over rays
  std::uint64_t n_marched = 0, n_differentiated = 0;  // samples
  std::string fault;                                  // not empty: the loss of a ray was not finite; names it
  std::vector<float> gradients;                       // of all networks
  // Every marched sample, for the occupancy grid.
  std::vector<std::uint32_t> visited_cell;
  std::vector<float> visited_sigma;

  // Scratch, reused.
  RayBatch batch;
  Samples kept, samples;  // in order of keeping, and sorted by ray
  std::vector<int> kept_ray;
  std::vector<std::vector<float>> t;  // without grid: distances per ray
  std::vector<float> sigma, position_codes, direction_codes, ray_codes, delta;
  std::vector<float> tau, weights, rgb, rgb_gradients, tau_gradients;
};

struct NerfShardContext {
  const Dataset& dataset;
  const SceneField& scene_field;
  const MlpField& field;
};

void RunNerfShard(const NerfShardContext& context, const BatchPlan& plan, int index, MlpShard* shard);

}  // namespace nerf
