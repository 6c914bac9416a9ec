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

namespace {

// Positions along a ray in the unit cube of a bounded scene, an affine function of the distance.
struct BoundedPath {
  BoundedPath(const SpaceMap& map, const Ray& ray) : speed(1.f / map.InnerSide()) {
    for (std::size_t i = 0; i < 3; ++i) {
      start[i] = (ray.origin[i] - map.centre[i]) * speed + 0.5f;
      slope[i] = ray.direction[i] * speed;
    }
  }
  void At(float t, float unit[3]) const {
    unit[0] = std::clamp(start[0] + t * slope[0], 0.f, 1.f);
    unit[1] = std::clamp(start[1] + t * slope[1], 0.f, 1.f);
    unit[2] = std::clamp(start[2] + t * slope[2], 0.f, 1.f);
  }
  // Bound on |d unit| / dt (maximum norm) from t on.
  float SpeedFrom(float, float) const { return speed; }

  float speed, start[3], slope[3];
};

// The same in contracted space.
struct ContractedPath {
  ContractedPath(const SpaceMap& space_map, const Ray& a_ray) : map(space_map), ray(a_ray) {}
  void Point(float t, float x[3]) const {
    x[0] = ray.origin[0] + t * ray.direction[0];
    x[1] = ray.origin[1] + t * ray.direction[1];
    x[2] = ray.origin[2] + t * ray.direction[2];
  }
  void At(float t, float unit[3]) const {
    float x[3];
    Point(t, x);
    map.ToUnit(x, unit);
  }
  // The reach is a maximum of convex functions of t: once it grows it keeps growing.
  float SpeedFrom(float t, float delta) const {
    float here[3], ahead[3];
    Point(t, here), Point(t + delta, ahead);
    const float reach = map.Reach(here);
    return map.MaxSpeed(reach, map.Reach(ahead) > reach);
  }

  const SpaceMap& map;
  const Ray& ray;
};

}  // namespace

template <typename Path>
int Sampler::MarchAlong(
    const Path& path, float step_scale, float t_last, int max_samples, float* t, Samples* samples) const {
  const float cell_size = 1.f / static_cast<float>(grid_.resolution());
  float start = *t;
  int count = 0;
  while (start < t_last && count < max_samples) {
    const float delta = Delta(step_scale, start), middle = start + 0.5f * delta;
    float unit[3];
    path.At(middle, unit);
    const int distance = grid_.DistanceAt(unit);
    if (distance > 1) {
      start += std::max(delta, static_cast<float>(distance - 1) * cell_size / path.SpeedFrom(middle, delta));
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

int Sampler::March(
    const Ray& ray, float step_scale, float t_last, int max_samples, float* t, Samples* samples) const {
  if (map_.unbounded)
    return MarchAlong(ContractedPath(map_, ray), step_scale, t_last, max_samples, t, samples);
  return MarchAlong(BoundedPath(map_, ray), step_scale, t_last, max_samples, t, samples);
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
