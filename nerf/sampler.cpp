#include "nerf/sampler.h"

namespace nerf {
namespace {

// A ray whose direction component is smaller moves by less than a float's resolution of a scene within any
// range; its slab distances would overflow, and be 0 / 0 on a face.
constexpr float kParallel = 1e-30f;

}  // namespace

void Sampler::Range(const Ray& ray, float* t_first, float* t_last) const {
  *t_first = options_.near;
  *t_last = options_.far;
  if (map_.unbounded) return;
  for (std::size_t i = 0; i < 3; ++i) {
    const float offset = ray.origin[i] - map_.centre[i];
    if (std::fabs(ray.direction[i]) < kParallel) {
      if (std::fabs(offset) > map_.half) *t_last = *t_first;
      continue;
    }
    const float a = (-map_.half - offset) / ray.direction[i], b = (map_.half - offset) / ray.direction[i];
    *t_first = std::max(*t_first, std::min(a, b));
    *t_last = std::min(*t_last, std::max(a, b));
  }
}

int Sampler::March(
    const Ray& ray, float step_scale, float t_last, int max_samples, float* t, Samples* samples) const {
  const float cell_size = 1.f / static_cast<float>(grid_.resolution());
  float start = *t;
  int count = 0;
  while (start < t_last && count < max_samples) {
    const float delta = Delta(step_scale, start), middle = start + 0.5f * delta;
    float x[3], unit[3];
    for (int i = 0; i < 3; ++i) x[i] = ray.origin[i] + middle * ray.direction[i];
    map_.ToUnit(x, unit);
    const int distance = grid_.DistanceAt(unit);
    if (distance > 1) {
      float speed = map_.MaxSpeed(0.f, false);
      if (map_.unbounded) {
        // The reach is a maximum of convex functions of t: once it grows it keeps growing.
        const float reach = map_.Reach(x);
        float ahead[3];
        for (int i = 0; i < 3; ++i) ahead[i] = x[i] + delta * ray.direction[i];
        speed = map_.MaxSpeed(reach, map_.Reach(ahead) > reach);
      }
      start += std::max(delta, static_cast<float>(distance - 1) * cell_size / speed);
      continue;
    }
    if (distance == 0) {
      samples->x.push_back(unit[0]);
      samples->y.push_back(unit[1]);
      samples->z.push_back(unit[2]);
      samples->delta.push_back(delta);
      samples->t.push_back(middle);
      samples->cell.push_back(grid_.CellAt(unit));
      ++count;
    }
    start += delta;
  }
  *t = start;
  return count;
}

void Sampler::Place(const Ray& ray,
                    const std::vector<float>& t,
                    const std::vector<float>& delta,
                    Samples* samples) const {
  for (std::size_t i = 0; i < t.size(); ++i) {
    float x[3], unit[3];
    for (int j = 0; j < 3; ++j) x[j] = ray.origin[j] + t[i] * ray.direction[j];
    map_.ToUnit(x, unit);
    const std::uint32_t cell = grid_.CellAt(unit);
    // Outside a bounded cube positions go on in its coordinates: clamped to a face they would share its
    // density.
    for (int j = 0; j < 3 && !map_.unbounded; ++j)
      unit[j] = (x[j] - map_.centre[static_cast<std::size_t>(j)]) / map_.half * 0.5f + 0.5f;
    const float* at = options_.scene_units ? x : unit;
    samples->x.push_back(at[0]);
    samples->y.push_back(at[1]);
    samples->z.push_back(at[2]);
    samples->delta.push_back(delta[i]);
    samples->t.push_back(t[i]);
    samples->cell.push_back(cell);
  }
}

}  // namespace nerf
