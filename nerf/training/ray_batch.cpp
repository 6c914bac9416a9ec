#include "nerf/training/ray_batch.h"

#include <utility>

#include "io/base/random.h"

namespace nerf {
namespace {

PixelTarget TargetOf(const Dataset& dataset, const BatchPlan& plan, std::size_t pixel) {
  const std::uint8_t* p = &dataset.pixels[pixel * static_cast<std::size_t>(dataset.channels)];
  float alpha = dataset.channels == 4 ? static_cast<float>(p[3]) / 255.f : 1.f;
  const float* background = plan.background ? plan.background->data() : nullptr;
  if (dataset.background && alpha > 0 && alpha < 1) {
    background = dataset.background->data();
    alpha = 1;  // the colour is whole
  }
  PixelTarget target = {{}, alpha, background};
  for (int j = 0; j < 3; ++j) target.premultiplied[j] = static_cast<float>(p[j]) / 255.f * alpha;
  return target;
}

}  // namespace

void DrawRays(
    const Dataset& dataset, const Sampler& sampler, const BatchPlan& plan, int shard, RayBatch* batch) {
  const auto samples_per_pixel = static_cast<std::uint64_t>(plan.samples_per_pixel),
             pixels = static_cast<std::uint64_t>(plan.n_rays) / samples_per_pixel,
             shards = static_cast<std::uint64_t>(plan.n_shards);
  const std::uint64_t first = pixels * static_cast<std::uint64_t>(shard) / shards;
  const std::uint64_t last = pixels * static_cast<std::uint64_t>(shard + 1) / shards;
  const auto n_used = static_cast<std::uint32_t>(dataset.n_used());
  // Pixels lie far apart in memory: reading them one after the other lets the processor wait for several.
  std::vector<std::pair<io::Random, std::size_t>> draws;
  for (std::uint64_t id = first; id < last; ++id) {
    io::Random random(plan.seed, io::Stream::kRay, plan.step, 2 * id);
    const std::size_t pixel = dataset.UsedPixel(random.Below(n_used));
    draws.emplace_back(random, pixel);
  }
  std::vector<PixelTarget> targets;
  for (const auto& draw : draws) targets.push_back(TargetOf(dataset, plan, draw.second));
  batch->rays.clear();
  for (std::size_t p = 0; p < draws.size(); ++p) {
    auto& [random, pixel] = draws[p];
    const View& view = dataset.ViewOf(pixel);
    const int in_view = static_cast<int>(pixel - view.first_pixel);
    const float phase = random.Uniform(), share = 1.f / static_cast<float>(plan.samples_per_pixel);
    for (int k = 0; k < plan.samples_per_pixel; ++k) {
      const PixelCell cell = CellOfPixel(k, plan.samples_per_pixel);
      const float u = plan.samples_per_pixel > 1 ? random.Uniform() : 0.5f,
                  v = plan.samples_per_pixel > 1 ? random.Uniform() : 0.5f;
      BatchRay ray{
          .id = (first + p) * samples_per_pixel + static_cast<std::uint64_t>(k),
          .ray = view.camera.RayThrough(in_view % view.width, in_view / view.width, cell.Dx(u), cell.Dy(v)),
          .target = targets[p],
      };
      sampler.Range(ray.ray, &ray.t, &ray.t_last);
      const float offset = phase + static_cast<float>(k) * share;
      ray.t += (offset < 1 ? offset : offset - 1) * sampler.Delta(plan.step_scale, ray.t);
      batch->rays.push_back(ray);
    }
  }
}

bool NextWave(const Sampler& sampler, const BatchPlan& plan, RayBatch* batch) {
  Samples& wave = batch->wave;
  MarchingRays& marching = batch->marching;
  wave.clear(), marching.clear();
  batch->wave_ray.clear();
  for (std::size_t r = 0; r < batch->rays.size(); ++r) {
    const BatchRay& ray = batch->rays[r];
    if (!ray.marching) continue;
    batch->wave_ray.push_back(static_cast<int>(r));
    sampler.AddRay(ray.ray, ray.t, ray.t_last, &marching);
  }
  sampler.March(plan.step_scale, plan.wave_samples, &marching, &wave);
  batch->wave_first.assign(1, 0);
  for (std::size_t i = 0; i < batch->wave_ray.size(); ++i) {
    BatchRay& ray = batch->rays[static_cast<std::size_t>(batch->wave_ray[i])];
    ray.t = marching.t[i];
    ray.marching = marching.count[i] == plan.wave_samples && ray.n_kept < plan.max_samples;
    batch->wave_first.push_back(batch->wave_first.back() + marching.count[i]);
  }
  return wave.size() > 0;
}

}  // namespace nerf
