// Keeps transients (transients.h) out of a training: looks for them while the field trains, and leaves out
// the pixels that show them.
#pragma once

#include <string>
#include <vector>

#include "nerf/training/field_fit.h"
#include "nerf/training/transients.h"

namespace nerf {

class TransientMasks {
 public:
  // All must outlive this. Leaves out at once what *state has found before.
  TransientMasks(const io::Scene& scene, Dataset* dataset, TrainState* state, io::Workers* workers);

  // Before a step of the field. Looks after kFirstLook steps, and again whenever the steps are kGrowth times
  // as many; no more once a later look has found almost nothing. Soon, for a field learns what it often
  // meets.
  void BeforeStep(const FieldFit& field);

  // Of each view that shows transients, its used pixels; empty for the others, and where none is used.
  std::vector<io::Mask> Masks() const;
  // A line for the report; empty when nothing was left out.
  std::string Describe() const;

  static constexpr std::uint64_t kFirstLook = 150, kGrowth = 3;

 private:
  void Apply();
  double ShareLeftOut() const;  // of the pixels that were used before

  const io::Scene& scene_;
  Dataset* const dataset_;
  TransientState* const state_;
  const std::uint64_t& n_steps_;  // of the field, that are done
  io::Workers* const workers_;
  const std::size_t n_used_;               // without transients left out, ...
  const std::vector<bool> used_;           // ... as are which those are and ...
  const std::vector<SparseDepth> depths_;  // ... the depths
  std::uint64_t applied_look_ = 0;         // TransientState::last_look of what the dataset leaves out
};

}  // namespace nerf
