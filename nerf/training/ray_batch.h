// The rays of a training batch, marched in waves: after each wave of samples their densities tell which rays
// still have light, so hidden space costs at most one wave. A batch is cut into the same shards for any
// number of threads and their results are merged in shard order, so training is bit-identical for any number
// of threads.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "nerf/data/dataset.h"
#include "nerf/rendering/volume_rendering.h"
#include "nerf/sampling/sampler.h"

namespace nerf {

struct BatchPlan {
  std::uint64_t seed = 0, step = 0;
  int n_rays = 0;  // of the whole batch, a multiple of samples_per_pixel
  // Rays of a pixel, a square number; they follow one another, random in the cells of a square lattice.
  int samples_per_pixel = 1;
  int n_shards = 16;
  float step_scale = 1;  // of the sampler's intervals
  // On which all pixels must look right; without it, on any (volume_rendering.h).
  std::optional<std::array<float, 3>> background;
  float distortion = 0;  // `hash`: weight of that loss (distortion.h), a mean over rays
  // `hash`: gradients of samples nearer than this are scaled by the square of their share of it [Philip and
  // Deschaintre 2023]. Near a camera few rays of others pass, and all of its own are dense: unscaled, things
  // that this one view alone has seen grow right before it. 0: none.
  float full_gradient_distance = 0;
  // Optical depth at which a ray ends; the light left over counts as background.
  float early_stop_depth = 6.9f;
  // Samples a ray contributes to one wave before its transmittance is looked at: what is marched and queried
  // in vain behind a surface is at most one wave.
  int wave_samples = 16;
  // Samples with less weight are dropped: they carry neither colour nor, relative to the others, gradient.
  float min_weight = 0;
  int max_samples = 1024;  // per ray, up to one wave more; what lies behind is treated as background
};

// A ray of the batch while it is marched.
struct BatchRay {
  std::uint64_t id = 0;  // in the batch
  Ray ray = {};
  PixelTarget target = {};
  float t = 0, t_last = 0;                     // where marching goes on, and where it ends
  float optical_depth = 0, transmittance = 1;  // so far
  int n_kept = 0;                              // samples whose weight counts
  bool marching = true;
};

struct RayBatch {
  std::vector<BatchRay> rays;
  std::vector<int> wave_ray;    // ray of each run of samples of the current wave ...
  std::vector<int> wave_first;  // ... and its first sample; one more entry at the end
  Samples wave;
  MarchingRays marching;  // of the wave
};

// Rays of one shard through random used pixels of all pictures, each starting within its first interval at
// random, those of a pixel staggered evenly. A pixel with one ray is met at its centre.
void DrawRays(
    const Dataset& dataset, const Sampler& sampler, const BatchPlan& plan, int shard, RayBatch* batch);

// Marches up to plan.wave_samples further samples of every ray that still has light into batch->wave. False:
// no ray is left.
bool NextWave(const Sampler& sampler, const BatchPlan& plan, RayBatch* batch);

// With the densities of the wave, calls keep(ray, sample) for the samples whose weight counts, and ends the
// rays that have become opaque.
template <typename Keep>
void EndWave(const BatchPlan& plan, const float* sigma, RayBatch* batch, const Keep& keep) {
  for (std::size_t run = 0; run < batch->wave_ray.size(); ++run) {
    BatchRay& ray = batch->rays[static_cast<std::size_t>(batch->wave_ray[run])];
    for (int i = batch->wave_first[run]; i < batch->wave_first[run + 1]; ++i) {
      const auto s = static_cast<std::size_t>(i);
      const float tau = sigma[s] * batch->wave.delta[s];
      // Written so that a NaN is kept, to be found in the loss.
      if (!(ray.transmittance * std::min(tau, 1.f) < plan.min_weight)) {
        keep(batch->wave_ray[run], s);
        ++ray.n_kept;
      }
      ray.optical_depth += tau;
      ray.transmittance = std::exp(-ray.optical_depth);
      if (ray.optical_depth > plan.early_stop_depth) {
        ray.marching = false;
        break;
      }
    }
  }
}

}  // namespace nerf
