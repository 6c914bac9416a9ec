// One shard of a training batch: a fixed range of the batch's rays, marched, encoded, rendered and
// differentiated by one thread into buffers of its own. The batch is cut into the same shards for any number
// of threads, and their results are merged in shard order, so training is bit-identical for any number of
// threads.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/dataset.h"
#include "nerf/hash_field.h"
#include "nerf/sampler.h"
#include "nerf/volume_rendering.h"

namespace nerf {

inline constexpr int kShards = 16;

struct BatchPlan {
  std::uint64_t seed = 0, step = 0;
  int n_rays = 0;        // of the whole batch
  float step_scale = 1;  // of the sampler's intervals
  float early_stop_depth =
      6.9f;                // optical depth at which a ray ends; the light left over counts as background
  int max_samples = 1024;  // per ray; what lies behind is treated as background
};

struct ShardResult {
  // Samples that light reaches, in ray order, and d loss / d features by level: [n_levels][stride / 4][4].
  Samples samples;
  std::vector<float> feature_gradients;
  std::size_t feature_gradient_stride = 0;  // floats between levels
  std::vector<float> weight_gradients;
  // Every marched sample, for the occupancy grid.
  std::vector<std::uint32_t> visited_cell;
  std::vector<float> visited_sigma;

  double loss = 0, squared_error = 0, opacity = 0;  // sums over rays
  bool finite = true;
  std::uint64_t first_bad_ray = 0;  // valid when !finite
};

// A ray of the batch while it is marched.
struct BatchRay {
  std::uint64_t id;  // in the batch
  Ray ray;
  PixelTarget target;
  float t, t_last;          // where marching goes on, and where it ends
  float optical_depth = 0;  // so far
  int n_kept = 0;           // samples that light reaches
  bool marching = true;
};

// Scratch of one thread, reused.
struct ShardScratch {
  std::vector<BatchRay> rays;
  std::vector<int> wave_ray;    // ray of each run of samples of the current wave ...
  std::vector<int> wave_first;  // ... and its first sample; one more entry at the end
  Samples wave;
  Samples kept;  // in the order they were kept
  std::vector<int> kept_ray;
  std::vector<float> kept_features, features;  // [n][32]: as kept, and in ray order
  std::vector<float> delta, tau, weights, logit_gradients, log_sigma_gradients;
  FieldRows rows;
};

void TrainShard(const Dataset& dataset,
                const HashField& field,
                const Sampler& sampler,
                const BatchPlan& plan,
                int shard,
                ShardScratch* scratch,
                ShardResult* result);

}  // namespace nerf
