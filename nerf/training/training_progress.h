// How far a training is through its schedule: the share of its steps or time that is used; once it was asked
// to end, it goes through the rest in a fraction of the time so far.
#pragma once

#include <cstdint>
#include <optional>

#include "nerf/training/train_options.h"

namespace nerf {

class TrainingProgress {
 public:
  // The rest of the schedule, when training is asked to end: with a falling rate and short intervals the
  // field is worth more than as it stands.
  static constexpr double kWindDownShare = 0.15, kMinWindDownS = 1;

  // options must outlive this.
  explicit TrainingProgress(const TrainOptions& options) : options_(options) {}

  double At(std::uint64_t step, double elapsed_s) const;  // in [0, 1]
  // NaN or infinity while it cannot be told.
  double LeftSeconds(std::uint64_t step, double elapsed_s) const;

  void End(std::uint64_t step, double elapsed_s);

 private:
  struct Ending {
    double progress, begin_s, length_s;  // progress: when it began
  };
  const TrainOptions& options_;
  std::optional<Ending> ending_;
};

}  // namespace nerf
