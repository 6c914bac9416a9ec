#include "nerf/sampling/sampler.h"

#include <cstring>
#include <limits>
#include <type_traits>

#include "nerf/kernels/kernels.h"

namespace nerf {
namespace {

// A ray whose direction component is smaller moves by less than a float's resolution of a scene within any
// range; its slab distances would overflow, and be 0 / 0 on a face.
constexpr float kParallel = 1e-30f;
// Values that are moved together when samples close up.
constexpr std::size_t kGapChunk = 4;

}  // namespace

void Sampler::Range(const Ray& ray, float* t_first, float* t_last) const {
  *t_first = options_.near;
  *t_last = options_.far;
  if (contraction_.unbounded) return;
  for (std::size_t i = 0; i < 3; ++i) {
    const float offset = ray.origin[i] - contraction_.centre[i];
    if (std::fabs(ray.direction[i]) < kParallel) {
      if (std::fabs(offset) > contraction_.half) *t_last = *t_first;
      continue;
    }
    const float a = (-contraction_.half - offset) / ray.direction[i],
                b = (contraction_.half - offset) / ray.direction[i];
    *t_first = std::max(*t_first, std::min(a, b));
    *t_last = std::min(*t_last, std::max(a, b));
  }
}

void Sampler::AddRay(const Ray& ray, float t, float t_last, MarchingRays* rays) const {
  const float scale = 1.f / (contraction_.unbounded ? contraction_.half : contraction_.InnerSide());
  for (std::size_t i = 0; i < 3; ++i) {
    rays->start[i].push_back((ray.origin[i] - contraction_.centre[i]) * scale +
                             (contraction_.unbounded ? 0.f : 0.5f));
    rays->slope[i].push_back(ray.direction[i] * scale);
  }
  rays->t.push_back(t);
  rays->t_last.push_back(t_last);
}

void Sampler::March(float step_scale, int max_samples, MarchingRays* rays, Samples* samples) const {
  const auto n = static_cast<std::size_t>(rays->size()), most = static_cast<std::size_t>(max_samples);
  const auto first = static_cast<std::size_t>(samples->size());
  rays->count.resize(n);
  samples->resize(first + n * most + kGapChunk);
  kernels::MarchPaths paths{.t_last = rays->t_last.data(), .contracted = contraction_.unbounded};
  for (int i = 0; i < 3; ++i) paths.start[i] = rays->start[i].data(), paths.slope[i] = rays->slope[i].data();
  kernels::ActiveKernels().march(grid_.Blocks(),
                                 paths,
                                 {step_scale * options_.step_size,
                                  step_scale * options_.cone_angle,
                                  contraction_.InnerSide() / static_cast<float>(grid_.resolution())},
                                 rays->size(),
                                 max_samples,
                                 rays->t.data(),
                                 rays->count.data(),
                                 {samples->t.data() + first,
                                  samples->delta.data() + first,
                                  samples->x.data() + first,
                                  samples->y.data() + first,
                                  samples->z.data() + first,
                                  samples->cell.data() + first});
  std::size_t to = first;
  for (std::size_t ray = 0; ray < n; ++ray) {
    const std::size_t from = first + ray * most, count = static_cast<std::size_t>(rays->count[ray]);
    // A few at a time, mostly once: what is written too far is written over or cut off.
    const auto close_gap = [&](auto* v) {
      std::remove_reference_t<decltype((*v)[0])> chunk[kGapChunk];
      for (std::size_t i = 0; i < count && to != from; i += kGapChunk) {
        std::memcpy(chunk, v->data() + from + i, sizeof chunk);
        std::memcpy(v->data() + to + i, chunk, sizeof chunk);
      }
    };
    close_gap(&samples->x), close_gap(&samples->y), close_gap(&samples->z);
    close_gap(&samples->delta), close_gap(&samples->t), close_gap(&samples->cell);
    to += count;
  }
  samples->resize(to);
}

void Sampler::Place(const Ray& ray,
                    const std::vector<float>& t,
                    const std::vector<float>& delta,
                    Samples* samples) const {
  for (std::size_t i = 0; i < t.size(); ++i) {
    float x[3], unit[3];
    for (int j = 0; j < 3; ++j) x[j] = ray.origin[j] + t[i] * ray.direction[j];
    contraction_.ToUnit(x, unit);
    const std::uint32_t cell = grid_.CellAt(unit);
    // Outside a bounded cube positions go on in its coordinates: clamped to a face they would share its
    // density.
    for (int j = 0; j < 3 && !contraction_.unbounded; ++j)
      unit[j] = (x[j] - contraction_.centre[static_cast<std::size_t>(j)]) / contraction_.half * 0.5f + 0.5f;
    const float* at = options_.scene_units ? x : unit;
    samples->x.push_back(at[0]);
    samples->y.push_back(at[1]);
    samples->z.push_back(at[2]);
    samples->delta.push_back(delta[i]);
    samples->t.push_back(t[i]);
    samples->cell.push_back(cell);
  }
}

void Sampler::PlaceAtInfinity(const Ray& ray, std::size_t i, Samples* samples) const {
  float unit[3];
  contraction_.ToUnitAtInfinity(ray.direction, unit);
  samples->x[i] = unit[0], samples->y[i] = unit[1], samples->z[i] = unit[2];
  samples->t[i] = std::numeric_limits<float>::infinity();
  samples->delta[i] = 0;
}

}  // namespace nerf
