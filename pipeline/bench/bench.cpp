// `pipeline bench WHAT`: starts one of the benchmarks.
#include "pipeline/bench/bench.h"

#include <cstdio>

#include "io/base/error.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"

namespace pipeline {
namespace {

struct Benchmark {
  const char* name;
  const char* help;
  int (*run)(int argc, const char* const* argv);
};
constexpr Benchmark kBenchmarks[] = {
    {"sfm",
     "poses: hard cases with truth (--matrix), speed against error on pictures (--images)",
     RunBenchSfm},
    {"kernels", "field: the kernels of `hash` against what the machine can do at most", RunBenchKernels},
    {"train", "field: quality over training time, for several budgets and seeds", RunBenchTrain},
};

}  // namespace

int RunBench(int argc, const char* const* argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what.empty() || what == "--help" || what == "-h") {
    std::printf("usage: pipeline bench WHAT [options]\n\n");
    for (const Benchmark& benchmark : kBenchmarks) std::printf("  %-8s %s\n", benchmark.name, benchmark.help);
    return static_cast<int>(what.empty() ? io::ExitCode::kUsage : io::ExitCode::kOk);
  }
  std::vector<std::string> names;
  for (const Benchmark& benchmark : kBenchmarks) {
    if (what == benchmark.name) return benchmark.run(argc - 1, argv + 1);
    names.push_back(benchmark.name);
  }
  return GuardedMain("pipeline bench", [&] {
    throw io::Error(io::ExitCode::kUsage,
                    "unknown benchmark '" + what + "'",
                    "Did you mean " + NearestName(what, names) + "? See pipeline bench --help");
  });
}

}  // namespace pipeline
