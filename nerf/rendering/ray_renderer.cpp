#include "nerf/rendering/ray_renderer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/process/interrupt.h"
#include "nerf/rendering/volume_rendering.h"

namespace nerf {
namespace {

constexpr int kRaysPerTask = 512, kStratifiedRays = 64;
// Samples a ray may contribute to one wave: what is queried in vain behind a surface is at most one wave.
constexpr int kWaveSamples = 4;
// A sample gets a colour when this much weight has gathered since the last one that did, and stands for it.
constexpr float kMinColourWeight = 1e-3f;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct RayState {
  int index;
  float t, t_last, optical_depth = 0;
  float gathered = 0;  // weight since the last sample with a colour ...
  float coloured = 0;  // ... and up to there
  int count = 0;       // samples in the current wave
};

struct Scratch {
  Samples samples;
  MarchingRays marching;
  std::vector<int> ray_of, active_of;  // of each sample
  AlignedVector<float> sigma, rgb, weights;
  AlignedVector<float> opacity, transmittance, tau;  // of a sample alone, behind it, optical depth
  std::vector<std::uint8_t> wanted;
  std::vector<RayState> active;
  std::vector<float> t, delta;

  void Resize() {
    const auto n = static_cast<std::size_t>(samples.size());
    sigma.resize(n), rgb.resize(3 * n), weights.resize(n), wanted.resize(n);
    opacity.resize(n), transmittance.resize(n), tau.resize(n);
  }
};

// Where the transmittance falls to one half within an interval around t, were its density constant; what was
// known, if it does not.
float MedianDepth(float before, float behind, float t, float delta, float known) {
  constexpr float kHalf = 0.5f;
  if (!(before > kHalf && behind <= kHalf)) return known;
  const float share = std::log(before / kHalf) / std::log(before / behind);
  return t + (share - 0.5f) * delta;
}

// Weight of a sample in an interval around t; the ray goes on behind it.
float Absorb(float opacity, float transmittance, float t, float delta, RenderedRay* ray) {
  const float weight = ray->transmittance * opacity;
  ray->depth += weight * t;
  ray->median_depth = MedianDepth(ray->transmittance, transmittance, t, delta, ray->median_depth);
  ray->transmittance = transmittance;
  return weight;
}

// Densities, and colours where they are wanted, of all samples.
void QueryAll(
    const SceneField& scene_field, std::span<const Ray> rays, int pass, RayValues values, Scratch* scratch) {
  const auto all = [values](int, int n, const float*, std::uint8_t* wanted) {
    std::fill_n(wanted, n, values == RayValues::kColours);
  };
  scene_field.field->Query(
      scratch->samples, rays, scratch->ray_of, pass, all, scratch->sigma.data(), scratch->rgb.data());
}

// Marches up to kWaveSamples further samples of every active ray.
void MarchWave(const Sampler& sampler, std::span<const Ray> rays, float step_scale, Scratch* scratch) {
  scratch->samples.clear(), scratch->marching.clear();
  scratch->ray_of.clear(), scratch->active_of.clear();
  for (const RayState& state : scratch->active)
    sampler.AddRay(rays[static_cast<std::size_t>(state.index)], state.t, state.t_last, &scratch->marching);
  sampler.March(step_scale, kWaveSamples, &scratch->marching, &scratch->samples);
  for (std::size_t i = 0; i < scratch->active.size(); ++i) {
    RayState& state = scratch->active[i];
    state.t = scratch->marching.t[i];
    state.count = scratch->marching.count[i];
    const std::size_t n = scratch->ray_of.size() + static_cast<std::size_t>(state.count);
    scratch->ray_of.resize(n, state.index);
    scratch->active_of.resize(n, static_cast<int>(i));
  }
  scratch->Resize();
}

// Absorbs along the wave's samples and adds the colours of those that get one.
void ShadeWave(const SceneField& scene_field,
               std::span<const Ray> rays,
               RayValues values,
               Scratch* scratch,
               RenderedRay* out) {
  const kernels::Kernels& kernels = kernels::ActiveKernels();
  const auto filter = [&](int first, int n, const float* sigma, std::uint8_t* wanted) {
    const auto begin = static_cast<std::size_t>(first), end = begin + static_cast<std::size_t>(n);
    for (std::size_t i = begin; i < end; ++i) {
      const float tau = *sigma++ * scratch->samples.delta[i];
      float& optical_depth = scratch->active[static_cast<std::size_t>(scratch->active_of[i])].optical_depth;
      scratch->opacity[i] = tau;
      scratch->transmittance[i] = -(optical_depth += tau);
    }
    kernels.one_minus_exp_neg(n, &scratch->opacity[begin]);
    kernels.exp(n, &scratch->transmittance[begin]);
    for (std::size_t i = begin; i < end; ++i) {
      RayState& state = scratch->active[static_cast<std::size_t>(scratch->active_of[i])];
      const Samples& samples = scratch->samples;
      state.gathered += Absorb(
          scratch->opacity[i], scratch->transmittance[i], samples.t[i], samples.delta[i], &out[state.index]);
      // Written so that a NaN is shown.
      *wanted++ = scratch->wanted[i] = values == RayValues::kColours && !(state.gathered < kMinColourWeight);
      if (!scratch->wanted[i]) continue;
      scratch->weights[i] = state.gathered;
      if (!scene_field.field->IsLearnt(samples.x[i], samples.y[i], samples.z[i]))
        out[state.index].unlearnt += state.gathered;
      state.coloured += state.gathered;
      state.gathered = 0;
    }
  };
  scene_field.field->Query(
      scratch->samples, rays, scratch->ray_of, 0, filter, scratch->sigma.data(), scratch->rgb.data());
  for (std::size_t i = 0; i < scratch->weights.size(); ++i) {
    if (!scratch->wanted[i]) continue;
    for (std::size_t j = 0; j < 3; ++j)
      out[scratch->ray_of[i]].rgb[j] += scratch->weights[i] * scratch->rgb[3 * i + j];
  }
}

// Adds the light from infinity to rays that still let some pass.
void ShadeInfinity(const SceneField& scene_field,
                   const Sampler& sampler,
                   std::span<const Ray> rays,
                   Scratch* scratch,
                   RenderedRay* out) {
  scratch->ray_of.clear();
  for (int i = 0; i < static_cast<int>(rays.size()); ++i)
    if (!(out[i].transmittance < kEarlyStopTransmittance)) scratch->ray_of.push_back(i);
  scratch->samples.resize(scratch->ray_of.size());
  for (std::size_t i = 0; i < scratch->ray_of.size(); ++i)
    sampler.PlaceAtInfinity(rays[static_cast<std::size_t>(scratch->ray_of[i])], i, &scratch->samples);
  scratch->Resize();
  QueryAll(scene_field, rays, 0, RayValues::kColours, scratch);
  for (std::size_t i = 0; i < scratch->ray_of.size(); ++i) {
    RenderedRay& ray = out[scratch->ray_of[i]];
    for (std::size_t j = 0; j < 3; ++j) ray.rgb[j] += ray.transmittance * scratch->rgb[3 * i + j];
    const Samples& samples = scratch->samples;
    if (!scene_field.field->IsLearnt(samples.x[i], samples.y[i], samples.z[i]))
      ray.unlearnt += ray.transmittance;
  }
}

void RenderPruned(const SceneField& scene_field,
                  std::span<const Ray> rays,
                  int samples_per_pixel,
                  float step_scale,
                  const RayLimits& limits,
                  RayValues values,
                  Scratch* scratch,
                  RenderedRay* out) {
  const Sampler sampler(scene_field.sampler_options, scene_field.contraction, scene_field.grid);
  scratch->active.clear();
  for (int i = 0; i < static_cast<int>(rays.size()); ++i) {
    RayState state{.index = i, .t = 0, .t_last = 0};
    sampler.Range(rays[static_cast<std::size_t>(i)], &state.t, &state.t_last);
    state.t_last = std::min(state.t_last, limits.end);
    if (limits.crop) Clip(*limits.crop, rays[static_cast<std::size_t>(i)], &state.t, &state.t_last);
    const float share = static_cast<float>(i % samples_per_pixel) / static_cast<float>(samples_per_pixel);
    state.t += share * sampler.Delta(step_scale, state.t);
    out[i] = {{0, 0, 0}, 1, 0, kInfinity, 0};
    scratch->active.push_back(state);
  }
  while (!scratch->active.empty()) {
    MarchWave(sampler, rays, step_scale, scratch);
    ShadeWave(scene_field, rays, values, scratch, out);
    std::size_t kept = 0;
    for (RayState state : scratch->active) {
      RenderedRay& ray = out[state.index];
      const bool left = state.count < kWaveSamples, opaque = ray.transmittance < kEarlyStopTransmittance;
      if (!left && !opaque) {
        scratch->active[kept++] = state;
        continue;
      }
      ray.depth += ray.transmittance * std::max(state.t_last, 0.f);
      const float share = state.coloured > 0 ? (1 - ray.transmittance) / state.coloured : 1;
      for (float& c : ray.rgb) c *= share;
      ray.unlearnt *= share;
    }
    scratch->active.resize(kept);
  }
  if (values == RayValues::kColours && scene_field.EndsAtInfinity() && limits.AreOpen())
    ShadeInfinity(scene_field, sampler, rays, scratch, out);
}

// A ray with n samples from `first` on, whose densities and colours are known, between the distances t_first
// and t_last; their weights stay in the scratch.
RenderedRay CompositeRay(
    std::size_t first, std::size_t n, float t_first, float t_last, RayValues values, Scratch* scratch) {
  float *tau = scratch->tau.data() + first, *weights = scratch->weights.data() + first;
  const float *delta = scratch->samples.delta.data() + first, *t = scratch->samples.t.data() + first;
  for (std::size_t i = 0; i < n; ++i)
    tau[i] = t[i] >= t_first && t[i] < t_last ? scratch->sigma[first + i] * delta[i] : 0;
  Opacities(static_cast<int>(n), tau, weights);
  RenderedRay ray = {};
  ray.transmittance = WeightsFromOpacities(static_cast<int>(n), tau, weights);
  if (values == RayValues::kColours)
    CompositeColour(static_cast<int>(n), weights, scratch->rgb.data() + 3 * first, ray.rgb);
  float behind = 1;
  ray.median_depth = kInfinity;
  for (std::size_t i = 0; i < n; ++i) {
    ray.depth += weights[i] * t[i];
    const float before = std::exchange(behind, std::max(0.f, behind - weights[i]));
    const float median = MedianDepth(before, behind, t[i], delta[i], kInfinity);
    // Intervals are not centred on their samples, and the last one may be endless.
    if (std::isfinite(median))
      ray.median_depth = std::clamp(median, i == 0 ? 0 : t[i - 1], i + 1 == n ? t_last : t[i + 1]);
  }
  ray.depth += ray.transmittance * t_last;
  return ray;
}

// Places the samples of all rays at the distances t and asks the field about them.
void QueryBins(const SceneField& scene_field,
               std::span<const Ray> rays,
               const std::vector<std::vector<float>>& t,
               int pass,
               RayValues values,
               Scratch* scratch) {
  const SamplerOptions& range = scene_field.sampler_options;
  const Sampler sampler(range, scene_field.contraction, scene_field.grid);
  const bool open_end = scene_field.field->quadrature().open_end;
  scratch->samples.clear();
  scratch->ray_of.clear();
  for (std::size_t r = 0; r < rays.size(); ++r) {
    IntervalLengths(range.near, range.far, open_end, t[r], &scratch->delta);
    sampler.Place(rays[r], t[r], scratch->delta, &scratch->samples);
    scratch->ray_of.resize(static_cast<std::size_t>(scratch->samples.size()), static_cast<int>(r));
  }
  scratch->Resize();
  QueryAll(scene_field, rays, pass, values, scratch);
}

// Every ray at the midpoints of its bins; with importance samples, a first network finds where they go.
void RenderStratified(const SceneField& scene_field,
                      std::span<const Ray> rays,
                      const RayLimits& limits,
                      RayValues values,
                      Scratch* scratch,
                      RenderedRay* out) {
  const QuadratureOptions quadrature = scene_field.field->quadrature();
  const float near = scene_field.sampler_options.near, far = scene_field.sampler_options.far;
  std::vector<std::vector<float>> t(rays.size());
  for (std::vector<float>& distances : t)
    StratifiedDistances(near, far, quadrature.n_samples, nullptr, &distances);
  const int n_passes = quadrature.n_importance > 0 ? 2 : 1;
  for (int pass = 0; pass < n_passes; ++pass) {
    QueryBins(scene_field, rays, t, pass, values, scratch);
    std::size_t first = 0;
    for (std::size_t r = 0; r < rays.size(); ++r) {
      const std::size_t n = t[r].size();
      float t_first = 0, t_last = std::min(far, limits.end);
      if (limits.crop) Clip(*limits.crop, rays[r], &t_first, &t_last);
      out[r] = CompositeRay(first, n, t_first, t_last, values, scratch);
      const float* weights = scratch->weights.data() + first;
      first += n;
      if (pass + 1 == n_passes) continue;
      AddImportanceSamples(
          near, far, std::vector<float>(weights, weights + n), quadrature.n_importance, nullptr, &t[r]);
    }
  }
}

}  // namespace

std::vector<RenderedRay> RenderRays(const SceneField& scene_field,
                                    std::span<const Ray> rays,
                                    int samples_per_pixel,
                                    float step_scale,
                                    io::Workers* workers,
                                    const RayLimits& limits,
                                    RayValues values) {
  std::vector<RenderedRay> out(rays.size());
  std::vector<Scratch> scratch(static_cast<std::size_t>(workers->n_threads()));
  const bool stratified = scene_field.field->quadrature().n_samples > 0;
  const int per_task = (stratified ? kStratifiedRays : kRaysPerTask) / samples_per_pixel * samples_per_pixel;
  const int n_tasks = (static_cast<int>(rays.size()) + per_task - 1) / per_task;
  workers->Run(n_tasks, [&](int task, int thread) {
    io::ThrowIfInterrupted();
    const std::size_t first = static_cast<std::size_t>(task) * static_cast<std::size_t>(per_task);
    const std::span<const Ray> mine =
        rays.subspan(first, std::min(static_cast<std::size_t>(per_task), rays.size() - first));
    Scratch* own = &scratch[static_cast<std::size_t>(thread)];
    if (stratified) {
      RenderStratified(scene_field, mine, limits, values, own, &out[first]);
    } else {
      RenderPruned(scene_field, mine, samples_per_pixel, step_scale, limits, values, own, &out[first]);
    }
  });
  return out;
}

std::vector<RenderedRay> RenderPixels(const SceneField& scene_field,
                                      std::span<const CameraPixel> pixels,
                                      int samples_per_pixel,
                                      float step_scale,
                                      io::Workers* workers,
                                      const RayLimits& limits,
                                      RayValues values) {
  const auto n = static_cast<std::size_t>(samples_per_pixel);
  std::vector<Ray> rays(pixels.size() * n);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const CameraPixel& pixel = pixels[i / n];
    const PixelCell cell = CellOfPixel(static_cast<int>(i % n), samples_per_pixel);
    rays[i] = pixel.camera->RayThrough(pixel.x, pixel.y, cell.Dx(0.5f), cell.Dy(0.5f));
  }
  const std::vector<RenderedRay> rendered =
      RenderRays(scene_field, rays, samples_per_pixel, step_scale, workers, limits, values);
  const float share = 1.f / static_cast<float>(n);
  std::vector<RenderedRay> means(pixels.size());
  for (std::size_t i = 0; i < rendered.size(); ++i) {
    RenderedRay& mean = means[i / n];
    for (int j = 0; j < 3; ++j) mean.rgb[j] += share * rendered[i].rgb[j];
    mean.transmittance += share * rendered[i].transmittance;
    mean.depth += share * rendered[i].depth;
    mean.median_depth += share * rendered[i].median_depth;
    mean.unlearnt += share * rendered[i].unlearnt;
  }
  return means;
}

}  // namespace nerf
