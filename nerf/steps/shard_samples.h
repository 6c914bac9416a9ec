// The samples of one shard of a training batch: its rays are marched, samples whose weight counts are kept,
// and these are sorted by ray for the forward and the backward pass of a network.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/steps/ray_batch.h"

namespace nerf {

struct ShardSamples {
  Samples sorted;              // by ray; without cells
  std::vector<int> ray_first;  // first sample of each ray; one more entry at the end
  // Every marched sample, for the occupancy grid.
  std::vector<std::uint32_t> visited_cell;
  std::vector<float> visited_sigma;

  std::size_t First(int ray) const {
    return static_cast<std::size_t>(ray_first[static_cast<std::size_t>(ray)]);
  }
  void clear() { sorted.clear(), ray_first.clear(), visited_cell.clear(), visited_sigma.clear(); }
};

// Kept samples in the order of the waves. Scratch of one thread, reused.
struct KeptSamples {
  Samples samples;
  std::vector<int> ray;
  std::vector<std::size_t> place;  // of each in ShardSamples::sorted, once they are sorted
  std::vector<float> sigma;        // of the current wave
};

// Appends sample i of `wave`, which belongs to `ray`.
void Keep(const Samples& wave, std::size_t i, int ray, KeptSamples* kept);

// Writes the kept samples to samples->sorted and their places to kept->place.
void SortByRay(const RayBatch& batch, KeptSamples* kept, ShardSamples* samples);

// Marches the rays of `batch` until all have ended. query(wave, sigma) computes the densities of a wave;
// on_keep(i) is called for each of its samples that is kept, in order.
template <typename Query, typename OnKeep>
void MarchAll(const Sampler& sampler,
              const BatchPlan& plan,
              const Query& query,
              const OnKeep& on_keep,
              RayBatch* batch,
              KeptSamples* kept,
              ShardSamples* samples) {
  kept->samples.clear();
  kept->ray.clear();
  while (NextWave(sampler, plan, batch)) {
    const Samples& wave = batch->wave;
    kept->sigma.resize(static_cast<std::size_t>(wave.size()));
    query(wave, kept->sigma.data());
    samples->visited_cell.insert(samples->visited_cell.end(), wave.cell.begin(), wave.cell.end());
    samples->visited_sigma.insert(samples->visited_sigma.end(), kept->sigma.begin(), kept->sigma.end());
    EndWave(plan, kept->sigma.data(), batch, [&](int ray, std::size_t i) {
      Keep(wave, i, ray, kept);
      on_keep(i);
    });
  }
  if (plan.ends_at_infinity) {
    WaveAtInfinity(sampler, plan, batch);
    kept->sigma.resize(static_cast<std::size_t>(batch->wave.size()));
    query(batch->wave, kept->sigma.data());
    for (std::size_t i = 0; i < batch->wave_ray.size(); ++i) {
      Keep(batch->wave, i, batch->wave_ray[i], kept);
      ++batch->rays[static_cast<std::size_t>(batch->wave_ray[i])].n_kept;
      on_keep(i);
    }
  }
  SortByRay(*batch, kept, samples);
}

// Rays of a shard that go through the networks together.
struct RayChunk {
  int ray_begin, ray_end;  // whole pixels
  std::size_t first, n;    // their samples in ShardSamples::sorted
};

// The chunk that begins with ray_begin: one pixel, and further ones while all have at most max_samples.
RayChunk NextChunk(const ShardSamples& samples, const BatchPlan& plan, int ray_begin, int max_samples);

}  // namespace nerf
