#include "nerf/ray_renderer.h"

#include <cmath>
#include <cstring>

#include "nerf/volume_rendering.h"

namespace nerf {
namespace {

constexpr int kRaysPerTask = 512;
// Samples a ray may contribute to one wave: surfaces are crossed in 5 to 20 samples.
constexpr int kWaveSamples = 8;
constexpr int kChunkRows = 512;

struct RayState {
  int index;
  float t, t_last, optical_depth = 0;
  int first = 0, count = 0;  // samples in the current wave
};

struct Scratch {
  Samples samples;
  std::vector<float> features, alpha;
  std::vector<RayState> active;
  FieldRows rows;
};

void ShadeWave(const SceneField& scene_field,
               std::span<const Ray> rays,
               Scratch* scratch,
               std::vector<float>* rgb_sigma) {
  const int n = scratch->samples.size();
  scratch->features.resize(static_cast<std::size_t>(n) * HashField::kInputs);
  rgb_sigma->resize(static_cast<std::size_t>(n) * 4);
  scene_field.field.Encode(scratch->samples, 0, n, scratch->features.data());
  std::vector<std::size_t> ray_of(static_cast<std::size_t>(n));
  for (std::size_t a = 0; a < scratch->active.size(); ++a) {
    const RayState& state = scratch->active[a];
    for (int i = state.first; i < state.first + state.count; ++i)
      ray_of[static_cast<std::size_t>(i)] = static_cast<std::size_t>(state.index);
  }
  std::vector<float> harmonics(rays.size() * kHarmonics);
  for (const RayState& state : scratch->active) {
    SphericalHarmonics(rays[static_cast<std::size_t>(state.index)].direction,
                       &harmonics[static_cast<std::size_t>(state.index) * kHarmonics]);
  }
  FieldRows& rows = scratch->rows;
  for (int first = 0; first < n; first += kChunkRows) {
    rows.Resize(std::min(kChunkRows, n - first));
    scene_field.field.QueryDensity(&scratch->features[static_cast<std::size_t>(first) * HashField::kInputs],
                                   &rows);
    for (std::size_t i = 0; i < static_cast<std::size_t>(rows.n); ++i) {
      std::memcpy(&rows.colour_in[i * HashField::kInputs + HashField::kOutputs],
                  &harmonics[ray_of[static_cast<std::size_t>(first) + i] * kHarmonics],
                  kHarmonics * sizeof(float));
    }
    scene_field.field.QueryColour(&rows);
    for (std::size_t i = 0; i < static_cast<std::size_t>(rows.n); ++i) {
      float* target = &(*rgb_sigma)[4 * (static_cast<std::size_t>(first) + i)];
      std::memcpy(target, &rows.rgb[3 * i], 3 * sizeof(float));
      target[3] = rows.sigma[i];
    }
  }
}

void RenderTask(const SceneField& scene_field,
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
  std::vector<float> rgb_sigma;
  while (!scratch->active.empty()) {
    scratch->samples.clear();
    for (RayState& state : scratch->active) {
      state.first = scratch->samples.size();
      state.count = sampler.March(rays[static_cast<std::size_t>(state.index)],
                                  step_scale,
                                  state.t_last,
                                  kWaveSamples,
                                  &state.t,
                                  &scratch->samples);
    }
    ShadeWave(scene_field, rays, scratch, &rgb_sigma);
    std::size_t kept = 0;
    for (RayState state : scratch->active) {
      RenderedRay& ray = out[state.index];
      for (int i = state.first; i < state.first + state.count; ++i) {
        const float* sample = &rgb_sigma[4 * static_cast<std::size_t>(i)];
        const auto s = static_cast<std::size_t>(i);
        const float tau = sample[3] * scratch->samples.delta[s];
        const float weight = ray.transmittance * -std::expm1(-tau);
        for (int j = 0; j < 3; ++j) ray.rgb[j] += weight * sample[j];
        ray.depth += weight * scratch->samples.t[s];
        state.optical_depth += tau;
        ray.transmittance = std::exp(-state.optical_depth);
      }
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

}  // namespace

std::vector<RenderedRay> RenderRays(const SceneField& scene_field,
                                    std::span<const Ray> rays,
                                    float step_scale,
                                    Workers* workers) {
  std::vector<RenderedRay> out(rays.size());
  std::vector<Scratch> scratch(static_cast<std::size_t>(workers->n_threads()));
  const int n_tasks = static_cast<int>((rays.size() + kRaysPerTask - 1) / kRaysPerTask);
  workers->Run(n_tasks, [&](int task, int thread) {
    const std::size_t first = static_cast<std::size_t>(task) * kRaysPerTask;
    const std::size_t count = std::min<std::size_t>(kRaysPerTask, rays.size() - first);
    RenderTask(scene_field,
               rays.subspan(first, count),
               step_scale,
               &scratch[static_cast<std::size_t>(thread)],
               &out[first]);
  });
  return out;
}

}  // namespace nerf
