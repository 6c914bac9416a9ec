#include "pipeline/bench/kernel_case.h"

#include <algorithm>

#include "io/process/resource_meter.h"

namespace pipeline {
namespace {

// Reading the clock takes about a microsecond.
constexpr double kShortestS = 5e-4;
constexpr int kMaxRuns = 1 << 20;

// Seconds of `runs` runs; with something to prepare, of each alone.
double TimeRuns(const KernelCase& c) {
  double sum_s = 0;
  if (c.prepare) {
    for (int i = 0; i < c.runs; ++i) {
      c.prepare();
      const double begin_s = io::ThreadCpuSeconds();
      c.run();
      sum_s += io::ThreadCpuSeconds() - begin_s;
    }
    return sum_s;
  }
  const double begin_s = io::ThreadCpuSeconds();
  for (int i = 0; i < c.runs; ++i) c.run();
  return io::ThreadCpuSeconds() - begin_s;
}

}  // namespace

void Measure(KernelCase* kernel_case) {
  KernelCase& c = *kernel_case;
  if (c.prepare) c.prepare();
  c.run();
  double seconds = TimeRuns(c);
  while (seconds < kShortestS && c.runs < kMaxRuns) {
    c.runs *= 2;
    seconds = TimeRuns(c);
  }
  c.best_s = std::min(c.best_s, seconds / c.runs);
}

}  // namespace pipeline
