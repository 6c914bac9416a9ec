#include "nerf/ray_renderer.h"

#include <algorithm>
#include <cmath>

#include "nerf/volume_rendering.h"

namespace nerf {
namespace {

constexpr int kRaysPerTask = 512, kStratifiedRays = 64;
// Samples a ray may contribute to one wave: surfaces are crossed in 5 to 20 samples.
constexpr int kWaveSamples = 8;
struct RayState {
  int index;
  float t, t_last, optical_depth = 0;
  int first = 0, count = 0;  // samples in the current wave
};

struct Scratch {
  Samples samples;
  std::vector<int> ray_of;
  std::vector<float> sigma, rgb;
  std::vector<RayState> active;
  std::vector<float> t, delta;
};

void Shade(const SceneField& scene_field, std::span<const Ray> rays, int pass, Scratch* scratch) {
  const auto n = static_cast<std::size_t>(scratch->samples.size());
  scratch->sigma.resize(n);
  scratch->rgb.resize(3 * n);
  scene_field.field->Query(
      scratch->samples, rays, scratch->ray_of, pass, scratch->sigma.data(), scratch->rgb.data());
}

// Adds samples [first, first + count) of the scratch to a ray.
void Composite(const Scratch& scratch, int first, int count, float* optical_depth, RenderedRay* ray) {
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(first + count); ++i) {
    const float tau = scratch.sigma[i] * scratch.samples.delta[i];
    const float weight = ray->transmittance * -std::expm1(-tau);
    for (std::size_t j = 0; j < 3; ++j) ray->rgb[j] += weight * scratch.rgb[3 * i + j];
    ray->depth += weight * scratch.samples.t[i];
    *optical_depth += tau;
    ray->transmittance = std::exp(-*optical_depth);
  }
}

void RenderPruned(const SceneField& scene_field,
                  std::span<const Ray> rays,
                  float step_scale,
                  Scratch* scratch,
                  RenderedRay* out) {
  const Sampler sampler(scene_field.sampler_options, scene_field.map, scene_field.grid);
  scratch->active.clear();
  for (int i = 0; i < static_cast<int>(rays.size()); ++i) {
    RayState state{.index = i, .t = 0, .t_last = 0};
    sampler.Range(rays[static_cast<std::size_t>(i)], &state.t, &state.t_last);
    out[i] = {{0, 0, 0}, 1, 0};
    scratch->active.push_back(state);
  }
  while (!scratch->active.empty()) {
    scratch->samples.clear();
    scratch->ray_of.clear();
    for (RayState& state : scratch->active) {
      state.first = scratch->samples.size();
      state.count = sampler.March(rays[static_cast<std::size_t>(state.index)],
                                  step_scale,
                                  state.t_last,
                                  kWaveSamples,
                                  &state.t,
                                  &scratch->samples);
      scratch->ray_of.resize(static_cast<std::size_t>(scratch->samples.size()), state.index);
    }
    Shade(scene_field, rays, 0, scratch);
    std::size_t kept = 0;
    for (RayState state : scratch->active) {
      RenderedRay& ray = out[state.index];
      Composite(*scratch, state.first, state.count, &state.optical_depth, &ray);
      const bool left = state.count < kWaveSamples, opaque = ray.transmittance < kEarlyStopTransmittance;
      if (left || opaque) {
        ray.depth += ray.transmittance * std::max(state.t_last, 0.f);
      } else {
        scratch->active[kept++] = state;
      }
    }
    scratch->active.resize(kept);
  }
}

// Every ray at the midpoints of its bins; with importance samples, a first network finds where they go.
void RenderStratified(const SceneField& scene_field,
                      std::span<const Ray> rays,
                      Scratch* scratch,
                      RenderedRay* out) {
  const QuadratureOptions quadrature = scene_field.field->quadrature();
  const Sampler sampler(scene_field.sampler_options, scene_field.map, scene_field.grid);
  const float near = scene_field.sampler_options.near, far = scene_field.sampler_options.far;
  const int n_rays = static_cast<int>(rays.size());
  std::vector<std::vector<float>> t(rays.size());
  for (std::vector<float>& distances : t)
    StratifiedDistances(near, far, quadrature.n_samples, nullptr, &distances);
  const int n_passes = quadrature.n_importance > 0 ? 2 : 1;
  for (int pass = 0; pass < n_passes; ++pass) {
    scratch->samples.clear();
    scratch->ray_of.clear();
    for (int r = 0; r < n_rays; ++r) {
      const std::vector<float>& distances = t[static_cast<std::size_t>(r)];
      IntervalLengths(near, far, quadrature.open_end, distances, &scratch->delta);
      sampler.Place(rays[static_cast<std::size_t>(r)], distances, scratch->delta, &scratch->samples);
      scratch->ray_of.resize(static_cast<std::size_t>(scratch->samples.size()), r);
    }
    Shade(scene_field, rays, pass, scratch);
    int first = 0;
    for (int r = 0; r < n_rays; ++r) {
      const int count = static_cast<int>(t[static_cast<std::size_t>(r)].size());
      float optical_depth = 0;
      out[r] = {{0, 0, 0}, 1, 0};
      if (pass + 1 < n_passes) {
        std::vector<float> weights;
        for (int i = first; i < first + count; ++i) {
          const float before = out[r].transmittance;
          Composite(*scratch, i, 1, &optical_depth, &out[r]);
          weights.push_back(before - out[r].transmittance);
        }
        AddImportanceSamples(
            near, far, weights, quadrature.n_importance, nullptr, &t[static_cast<std::size_t>(r)]);
      } else {
        Composite(*scratch, first, count, &optical_depth, &out[r]);
        out[r].depth += out[r].transmittance * far;
      }
      first += count;
    }
  }
}

}  // namespace

std::vector<RenderedRay> RenderRays(const SceneField& scene_field,
                                    std::span<const Ray> rays,
                                    float step_scale,
                                    Workers* workers) {
  std::vector<RenderedRay> out(rays.size());
  std::vector<Scratch> scratch(static_cast<std::size_t>(workers->n_threads()));
  const bool stratified = scene_field.field->quadrature().n_samples > 0;
  const int per_task = stratified ? kStratifiedRays : kRaysPerTask;
  const int n_tasks = (static_cast<int>(rays.size()) + per_task - 1) / per_task;
  workers->Run(n_tasks, [&](int task, int thread) {
    const std::size_t first = static_cast<std::size_t>(task) * static_cast<std::size_t>(per_task);
    const std::span<const Ray> mine =
        rays.subspan(first, std::min(static_cast<std::size_t>(per_task), rays.size() - first));
    Scratch* own = &scratch[static_cast<std::size_t>(thread)];
    if (stratified) {
      RenderStratified(scene_field, mine, own, &out[first]);
    } else {
      RenderPruned(scene_field, mine, step_scale, own, &out[first]);
    }
  });
  return out;
}

}  // namespace nerf
