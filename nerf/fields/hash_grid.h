// Multi-resolution hash grid [Müller et al. 2022]: positions in the unit cube to features, level by level,
// and gradients back. Values and the optimiser's moments are float; a copy of the values rounded to bfloat16,
// half as large and so nearer to the processor, can serve the look-ups.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/fields/radiance_field.h"
#include "nerf/kernels/aligned_vector.h"
#include "nerf/kernels/kernels.h"

namespace nerf {

struct HashGridOptions {
  int n_levels = 8;
  int log2_hashmap_size = 18;  // entries of a hashed level
  int base_resolution = 16;    // cells per axis of the coarsest level
  int finest_resolution = 512;
  bool bf16 = false;  // look-ups read bfloat16
  // The optimiser keeps one second moment per entry and no momentum, instead of Adam's two moments per value.
  // So short runs reach more, and long runs less.
  bool entry_moments = false;
};

class HashGrid {
 public:
  HashGrid(const HashGridOptions& options, std::uint64_t seed);

  // Features of all levels for samples [first, first + n), rows of n_features().
  template <typename Real>
  void Encode(const Samples& samples, int first, int n, Real* features) const;
  // Adds the gradients of one level for feature gradients [n][kFeatures] to `gradients`, which holds
  // gradient_size() values, zero at first.
  template <typename Real>
  void Scatter(
      int level, const Real* feature_gradients, const Samples& samples, int n, float* gradients) const;
  // Adds d loss / d position of samples [0, n) to gradients x, y, z; feature gradients as for Scatter.
  template <typename Real>
  void PositionGradient(int level,
                        const Real* feature_gradients,
                        const Samples& samples,
                        int n,
                        float* const gradients[3]) const;
  // Consumes and clears the gradients of one level.
  void Step(int level, const kernels::AdamStep& step, float* gradients);
  // Of the largest level. The gradients belong to the caller: one buffer per thread serves all levels and
  // stays in its caches.
  std::size_t gradient_size() const;

  // To be called after values were set through State().
  void Refresh();
  std::vector<Tensor> State();
  std::size_t n_parameters() const { return table_.size(); }
  int n_features() const { return options_.n_levels * kernels::kFeatures; }
  const HashGridOptions& options() const { return options_; }
  const std::vector<kernels::GridLevel>& levels() const { return levels_; }

 private:
  HashGridOptions options_;
  const kernels::Kernels& kernels_;
  std::vector<kernels::GridLevel> levels_;
  AlignedVector<float> table_;            // [entries][kFeatures]
  AlignedVector<float> m_, v_;            // the same, or empty and [entries]
  AlignedVector<kernels::Bf16> rounded_;  // of table_; empty unless options_.bf16
};

}  // namespace nerf
