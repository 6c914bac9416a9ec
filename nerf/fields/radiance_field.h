// What rendering, occupancy and checkpoints ask of a field. `hash` (hash_field.h) and `nerf` (mlp_field.h)
// answer.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "nerf/fields/field_kind.h"
#include "nerf/sampling/quadrature.h"
#include "nerf/sampling/sampler.h"

namespace nerf {

// One array of a field's state, for checkpoints: learnt values and the optimiser's moments.
struct Tensor {
  std::string name;
  std::span<float> values;
};

// Which colours are wanted: receives the densities of samples [first, first + n), each sample once and in
// order, and sets wanted [n].
using ColourFilter = std::function<void(int first, int n, const float* sigma, std::uint8_t* wanted)>;

// Values of a field's options by name; what a checkpoint needs to make the field again.
using FieldConfig = std::map<std::string, double>;

class RadianceField {
 public:
  virtual ~RadianceField() = default;

  virtual FieldKind kind() const = 0;
  virtual FieldConfig Config() const = 0;
  virtual std::vector<Tensor> State() = 0;
  // To be called after values were set through State().
  virtual void Refresh() = 0;
  virtual std::size_t n_parameters() const = 0;

  // Quadrature of the rays, for fields that do not follow the occupancy grid.
  virtual QuadratureOptions quadrature() const { return {}; }
  // Where in its pixel a ray starts: the centre, except for fields trained as the report did.
  virtual double pixel_offset() const { return 0.5; }

  // Whether training samples came near a place of the unit cube. What the field has elsewhere means nothing.
  virtual bool IsLearnt(float /*x*/, float /*y*/, float /*z*/) const { return true; }
  // Densities sigma [n] per scene unit at all samples. Safe to call from several threads, as is Query.
  virtual void QueryDensity(const Samples& samples, float* sigma) const = 0;
  // Densities and colours rgb [n][3] in [0, 1], arbitrary where not wanted; sample i lies on rays[ray_of[i]].
  // pass: 0, or 1 for the second of two networks (QuadratureOptions::n_importance).
  virtual void Query(const Samples& samples,
                     std::span<const Ray> rays,
                     std::span<const int> ray_of,
                     int pass,
                     const ColourFilter& filter,
                     float* sigma,
                     float* rgb) const = 0;
};

}  // namespace nerf
