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
#include "nerf/data/near_cameras.h"
#include "nerf/rendering/volume_rendering.h"
#include "nerf/sampling/sampler.h"

namespace nerf {

struct BatchPlan {
  std::uint64_t seed = 0, step = 0;
  int n_rays = 0;  // of the whole batch, a multiple of samples_per_pixel
  // Rays through each pixel, a square number: one at random in each cell of a square lattice. They follow one
  // another in the batch.
  int samples_per_pixel = 1;
  int n_shards = 16;
  float step_scale = 1;  // of the sampler's intervals
  // The background on which pixels are compared; none: the mean over all backgrounds (volume_rendering.h).
  std::optional<std::array<float, 3>> background;
  float distortion = 0;  // `hash`: weight of that loss (distortion.h), a mean over rays
  // `hash`: t0. Close to a camera, samples are seen by almost no other view; scaling their gradients by
  // (t / t0)^2 where t < t0 prevents floaters [Philip and Deschaintre 2023]. 0: no scaling.
  float full_gradient_distance = 0;
  // Rays that leave the scene end at infinity, see SceneField::EndsAtInfinity.
  bool ends_at_infinity = false;
  // `hash`: share of the pixels that are drawn among Dataset::depths, and weight of their loss
  // (depth_loss.h).
  float depth_share = 0, depth_weight = 0;
  // `hash`: the loss of near_cameras.h and its weight; null: none.
  const NearCameras* near_cameras = nullptr;
  float nearness_weight = 0;
  // `hash`: of the opacity of what stands before the sky (Dataset::sky).
  float sky_weight = 0;
  // Optical depth at which a ray ends; the light left over counts as background, whatever lies behind.
  float early_stop_depth = 6.9f;
  // Samples of a ray in one wave. Its transmittance is looked at after each wave, so at most one wave is
  // marched and queried in vain behind a surface.
  int wave_samples = 16;
  // Samples with less weight are not differentiated: they add almost nothing to colour or gradient.
  float min_weight = 0;
  int max_samples = 1024;  // per ray, up to one wave more; what lies behind is treated as background
};

// BatchPlan::full_gradient_distance of an unbounded scene: 2, or less where 5 % of the sparse depths are
// nearer, as on a drive along a street.
float FullGradientDistance(const Dataset& dataset);

// A ray of the batch while it is marched.
struct BatchRay {
  std::uint64_t id = 0;  // in the batch
  std::size_t view = 0;
  Ray ray = {};
  PixelTarget target = {};
  float depth = 0;  // distance of the sparse point that it goes through; 0: none
  bool shows_sky = false;
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
// random, those of a pixel staggered evenly. A pixel with one ray is met at its centre, one that was drawn
// for its depth where the point is.
void DrawRays(
    const Dataset& dataset, const Sampler& sampler, const BatchPlan& plan, int shard, RayBatch* batch);

// Marches up to plan.wave_samples further samples of every ray that still has light into batch->wave. False:
// no ray is left.
bool NextWave(const Sampler& sampler, const BatchPlan& plan, RayBatch* batch);

// The last wave: one sample at infinity for every ray that still has light, ray by ray in batch->wave_ray.
void WaveAtInfinity(const Sampler& sampler, const BatchPlan& plan, RayBatch* batch);

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
