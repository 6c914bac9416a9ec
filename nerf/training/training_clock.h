// Training time: what has passed since it began, without monitoring and checkpoints.
#pragma once

#include <chrono>

#include "io/process/resource_meter.h"

namespace nerf {

class TrainingClock {
 public:
  // Continues a run that had used so many seconds.
  void Resume(double resumed_s) { resumed_s_ = resumed_s; }

  double resumed_s() const { return resumed_s_; }

  // Seconds of training, those before it was resumed included; and of this program's processor time.
  double Elapsed() const { return resumed_s_ + Seconds(Clock::now() - start_) - excluded_s_; }
  double CpuElapsed() const { return io::ProcessCpuSeconds() - excluded_cpu_s_; }

  // Does work whose time does not count; returns its seconds.
  template <typename Work>
  double Exclude(const Work& work) {
    const Clock::time_point begin = Clock::now();
    const double cpu_begin = io::ProcessCpuSeconds();
    work();
    const double seconds = Seconds(Clock::now() - begin);
    excluded_s_ += seconds;
    excluded_cpu_s_ += io::ProcessCpuSeconds() - cpu_begin;
    return seconds;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static double Seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

  const Clock::time_point start_ = Clock::now();
  double resumed_s_ = 0, excluded_s_ = 0, excluded_cpu_s_ = 0;
};

}  // namespace nerf
