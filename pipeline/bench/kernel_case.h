// One piece of work of `pipeline bench kernels`, and its time.
#pragma once

#include <functional>
#include <limits>
#include <string>

namespace pipeline {

struct KernelCase {
  std::string build, kernel, format;  // "avx2", "matmul 32x64", "fp32"
  std::string item;                   // what the time is stated for: "sample", "element"
  double items = 0;                   // of one run
  std::string unit;                   // of the rate: 1e9 of something per second, as "GFLOP/s"
  double work = 0;                    // of one run, counted in that something
  std::string limit;                  // Name() of the case whose rate bounds this one; empty: none does
  std::function<void()> run;
  std::function<void()> prepare;  // before each run, not timed; may be empty

  int runs = 1;                                             // that are timed together
  double best_s = std::numeric_limits<double>::infinity();  // of one run

  std::string Name() const { return build + " " + kernel + " " + format; }
  double Rate() const { return work / best_s * 1e-9; }  // in `unit`
  double NanosecondsPerItem() const { return best_s * 1e9 / items; }
};

// Times a case once more: a run that warms the caches, then as many as can be told from the clock's own
// cost. Keeps the best time of all calls.
void Measure(KernelCase* kernel_case);

}  // namespace pipeline
