#include "nerf/steps/ray_batch.h"

#include <algorithm>
#include <utility>

#include "io/base/median.h"
#include "io/base/random.h"

namespace nerf {
namespace {

// `near` of normalised scenes, where cameras around a subject have nothing, and the share of sparse depths
// that may lie nearer than where gradients are whole.
constexpr float kFullGradientDistance = 2;
constexpr double kNearerShare = 0.05;

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

// A pixel and what its rays need.
struct Draw {
  io::Random random;
  std::size_t pixel;
  const SparseDepth* depth;  // null: unknown
};

Draw DrawPixel(const Dataset& dataset, const BatchPlan& plan, std::uint64_t id) {
  io::Random random(plan.seed, io::Stream::kRay, plan.step, 2 * id);
  if (plan.depth_share > 0 && !dataset.depths.empty() && random.Uniform() < plan.depth_share) {
    const SparseDepth& depth =
        dataset.depths[random.Below(static_cast<std::uint32_t>(dataset.depths.size()))];
    return {random, dataset.PixelOf(depth), &depth};
  }
  const std::size_t pixel = dataset.UsedPixel(random.Below(static_cast<std::uint32_t>(dataset.n_used())));
  return {random, pixel, nullptr};
}

// Ray number k through a drawn pixel.
Ray RayOf(const Dataset& dataset, const BatchPlan& plan, int k, Draw* draw) {
  const View& view = dataset.ViewOf(draw->pixel);
  const int in_view = static_cast<int>(draw->pixel - view.first_pixel), x = in_view % view.width,
            y = in_view / view.width;
  if (const SparseDepth* depth = draw->depth) {
    return view.camera.RayThrough(
        x, y, depth->x - static_cast<float>(x) - 0.5f, depth->y - static_cast<float>(y) - 0.5f);
  }
  const PixelCell cell = CellOfPixel(k, plan.samples_per_pixel);
  const float u = plan.samples_per_pixel > 1 ? draw->random.Uniform() : 0.5f,
              v = plan.samples_per_pixel > 1 ? draw->random.Uniform() : 0.5f;
  return view.camera.RayThrough(x, y, cell.Dx(u), cell.Dy(v));
}

}  // namespace

void DrawRays(
    const Dataset& dataset, const Sampler& sampler, const BatchPlan& plan, int shard, RayBatch* batch) {
  const auto samples_per_pixel = static_cast<std::uint64_t>(plan.samples_per_pixel),
             pixels = static_cast<std::uint64_t>(plan.n_rays) / samples_per_pixel,
             shards = static_cast<std::uint64_t>(plan.n_shards);
  const std::uint64_t first = pixels * static_cast<std::uint64_t>(shard) / shards;
  const std::uint64_t last = pixels * static_cast<std::uint64_t>(shard + 1) / shards;
  // Pixels lie far apart in memory: reading them one after the other lets the processor wait for several.
  std::vector<Draw> draws;
  for (std::uint64_t id = first; id < last; ++id) draws.push_back(DrawPixel(dataset, plan, id));
  std::vector<PixelTarget> targets;
  for (const Draw& draw : draws) targets.push_back(TargetOf(dataset, plan, draw.pixel));
  batch->rays.clear();
  for (std::size_t p = 0; p < draws.size(); ++p) {
    const float phase = draws[p].random.Uniform(), share = 1.f / static_cast<float>(plan.samples_per_pixel);
    for (int k = 0; k < plan.samples_per_pixel; ++k) {
      BatchRay ray{
          .id = (first + p) * samples_per_pixel + static_cast<std::uint64_t>(k),
          .view = static_cast<std::size_t>(&dataset.ViewOf(draws[p].pixel) - dataset.views.data()),
          .ray = RayOf(dataset, plan, k, &draws[p]),
          .target = targets[p],
          .depth = draws[p].depth ? draws[p].depth->t : 0,
          .shows_sky = !draws[p].depth && dataset.ShowsSky(draws[p].pixel),
      };
      sampler.Range(ray.ray, &ray.t, &ray.t_last);
      const float offset = phase + static_cast<float>(k) * share;
      ray.t += (offset < 1 ? offset : offset - 1) * sampler.Delta(plan.step_scale, ray.t);
      batch->rays.push_back(ray);
    }
  }
}

float FullGradientDistance(const Dataset& dataset) {
  std::vector<float> depths;
  for (const SparseDepth& depth : dataset.depths) depths.push_back(depth.t);
  if (depths.empty()) return kFullGradientDistance;
  return std::min(kFullGradientDistance, io::Quantile(std::move(depths), kNearerShare));
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

void WaveAtInfinity(const Sampler& sampler, const BatchPlan& plan, RayBatch* batch) {
  batch->wave_ray.clear();
  for (std::size_t r = 0; r < batch->rays.size(); ++r) {
    // Written so that a NaN is kept, to be found in the loss.
    if (!(batch->rays[r].optical_depth > plan.early_stop_depth))
      batch->wave_ray.push_back(static_cast<int>(r));
  }
  batch->wave.resize(batch->wave_ray.size());
  for (std::size_t i = 0; i < batch->wave_ray.size(); ++i)
    sampler.PlaceAtInfinity(batch->rays[static_cast<std::size_t>(batch->wave_ray[i])].ray, i, &batch->wave);
}

}  // namespace nerf
