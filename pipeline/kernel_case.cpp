#include "pipeline/kernel_case.h"

#include <time.h>

#include <algorithm>

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
      const double begin_s = ThreadCpuSeconds();
      c.run();
      sum_s += ThreadCpuSeconds() - begin_s;
    }
    return sum_s;
  }
  const double begin_s = ThreadCpuSeconds();
  for (int i = 0; i < c.runs; ++i) c.run();
  return ThreadCpuSeconds() - begin_s;
}

}  // namespace

double ThreadCpuSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

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
