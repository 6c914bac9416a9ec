#include "nerf/steps/shard_samples.h"

namespace nerf {

void Keep(const Samples& wave, std::size_t i, int ray, KeptSamples* kept) {
  kept->samples.x.push_back(wave.x[i]);
  kept->samples.y.push_back(wave.y[i]);
  kept->samples.z.push_back(wave.z[i]);
  kept->samples.t.push_back(wave.t[i]);
  kept->samples.delta.push_back(wave.delta[i]);
  kept->ray.push_back(ray);
}

void SortByRay(const RayBatch& batch, KeptSamples* kept, ShardSamples* samples) {
  samples->ray_first.assign(1, 0);
  for (const BatchRay& ray : batch.rays) samples->ray_first.push_back(samples->ray_first.back() + ray.n_kept);
  std::vector<int> next(samples->ray_first.begin(), samples->ray_first.end() - 1);
  const std::size_t n = kept->ray.size();
  const Samples& from = kept->samples;
  Samples& sorted = samples->sorted;
  sorted.x.resize(n), sorted.y.resize(n), sorted.z.resize(n), sorted.t.resize(n), sorted.delta.resize(n);
  kept->place.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto to = static_cast<std::size_t>(next[static_cast<std::size_t>(kept->ray[i])]++);
    sorted.x[to] = from.x[i], sorted.y[to] = from.y[i], sorted.z[to] = from.z[i];
    sorted.t[to] = from.t[i], sorted.delta[to] = from.delta[i];
    kept->place[i] = to;
  }
}

RayChunk NextChunk(const ShardSamples& samples, const BatchPlan& plan, int ray_begin, int max_samples) {
  const int n_rays = static_cast<int>(samples.ray_first.size()) - 1;
  const std::size_t first = samples.First(ray_begin);
  int ray_end = ray_begin + plan.samples_per_pixel;
  while (ray_end < n_rays &&
         samples.First(ray_end + plan.samples_per_pixel) - first <= static_cast<std::size_t>(max_samples))
    ray_end += plan.samples_per_pixel;
  return {ray_begin, ray_end, first, samples.First(ray_end) - first};
}

}  // namespace nerf
