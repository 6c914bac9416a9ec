// Samples along a ray where the occupancy grid says there may be something.
//
// The ray is cut into intervals [t, t + delta) with delta = step_scale * max(step_size, cone_angle * t); an
// interval yields a sample at its middle when the cell there is occupied. Empty space is crossed in jumps
// that cannot pass an occupied cell.
#pragma once

#include <algorithm>
#include <vector>

#include "nerf/kernels/aligned_vector.h"
#include "nerf/sampling/occupancy_grid.h"
#include "nerf/sampling/ray.h"
#include "nerf/sampling/scene_contraction.h"

namespace nerf {

struct SamplerOptions {
  float near = 0.05f, far = 6;  // distances along the ray, scene units
  float step_size = 0.01f;      // shortest interval, scene units
  float cone_angle = 0;         // interval per distance; 0: constant intervals
  bool scene_units = false;     // of the positions that Place writes; else the unit cube, as March
};

// Positions in the unit cube (or scene units, see SamplerOptions), one entry per sample.
struct Samples {
  AlignedVector<float> x, y, z, delta, t;
  AlignedVector<std::uint32_t> cell;

  int size() const { return static_cast<int>(x.size()); }
  void clear() { resize(0); }
  void resize(std::size_t n) {
    x.resize(n), y.resize(n), z.resize(n), delta.resize(n), t.resize(n), cell.resize(n);
  }
};

// Rays on their way through the occupancy grid, in the coordinates of kernels/march.h.
struct MarchingRays {
  std::vector<float> start[3], slope[3];
  std::vector<float> t, t_last;  // where marching goes on, and where it ends
  std::vector<int> count;        // samples of the last March

  int size() const { return static_cast<int>(t.size()); }
  void clear() {
    for (int i = 0; i < 3; ++i) start[i].clear(), slope[i].clear();
    t.clear(), t_last.clear(), count.clear();
  }
};

class Sampler {
 public:
  Sampler(const SamplerOptions& options, const SceneContraction& contraction, const OccupancyGrid& grid)
      : options_(options), contraction_(contraction), grid_(grid) {}
  const SamplerOptions& options() const { return options_; }

  // First and last distance at which the ray can have samples; first >= last when it misses the scene.
  void Range(const Ray& ray, float* t_first, float* t_last) const;

  // Adds a ray whose marching begins at distance t.
  void AddRay(const Ray& ray, float t, float t_last, MarchingRays* rays) const;
  // Appends up to `max_samples` further samples of each ray to *samples, ray by ray, and advances the rays. A
  // ray with fewer has left the scene.
  void March(float step_scale, int max_samples, MarchingRays* rays, Samples* samples) const;

  // Appends samples at given distances with given interval lengths, whatever the grid says.
  void Place(const Ray& ray,
             const std::vector<float>& t,
             const std::vector<float>& delta,
             Samples* samples) const;

  // Sets sample i to the end of the ray at infinity, an interval without length.
  void PlaceAtInfinity(const Ray& ray, std::size_t i, Samples* samples) const;

  // Length of the interval that starts at t.
  float Delta(float step_scale, float t) const {
    return step_scale * std::max(options_.step_size, options_.cone_angle * t);
  }

 private:
  SamplerOptions options_;
  const SceneContraction& contraction_;
  const OccupancyGrid& grid_;
};

}  // namespace nerf
