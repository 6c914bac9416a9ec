// How far a part of a training is through its schedule: the share of its steps or time that is used; once it
// was asked to end, it goes through the rest in a fraction of the time so far.
#pragma once

#include <cstdint>
#include <optional>

namespace nerf {

class TrainingProgress {
 public:
  // The rest of the schedule, when training is asked to end: with a falling rate and short intervals the
  // field is worth more than as it stands.
  static constexpr double kWindDownShare = 0.15, kMinWindDownS = 1;

  // steps > 0: by steps; else by time.
  TrainingProgress(int steps, double time_s) : steps_(steps), time_s_(time_s) {}

  double At(std::uint64_t step, double elapsed_s) const;  // in [0, 1]
  // NaN or infinity while it cannot be told.
  double LeftSeconds(std::uint64_t step, double elapsed_s) const;

  void End(std::uint64_t step, double elapsed_s);

 private:
  struct Ending {
    double progress, begin_s, length_s;  // progress: when it began
  };
  int steps_;
  double time_s_;
  std::optional<Ending> ending_;
};

}  // namespace nerf
