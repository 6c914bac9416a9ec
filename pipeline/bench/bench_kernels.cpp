// `pipeline bench sfm --kernels`: the matching kernel against what its processor can do at most.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "io/base/atomic_file.h"
#include "io/base/median.h"
#include "io/process/stopwatch.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/bench_table.h"
#include "sfm/features/kernels/kernels.h"
#include "sfm/synthetic/random.h"

namespace pipeline {
namespace {

namespace kernels = sfm::kernels;

constexpr int kRounds = 9;

// Rows of length 512 with the many small and few large entries of RootSIFT.
std::vector<std::uint8_t> Descriptors(int n, std::uint64_t seed) {
  sfm::Random random(seed, 0);
  std::vector<std::uint8_t> rows;
  for (int i = 0; i < n; ++i) {
    double values[kernels::kDimensions], sum = 0;
    for (double& value : values) sum += value = std::pow(random.Uniform(), 2);
    for (const double value : values) {
      rows.push_back(static_cast<std::uint8_t>(std::lround(512 * std::sqrt(value / sum))));
    }
  }
  return rows;
}

}  // namespace

void RunKernels(const KernelOptions& options) {
  const int n = options.features;
  const std::vector<std::uint8_t> a = Descriptors(n, 1), b = Descriptors(n, 2);
  std::vector<kernels::Neighbour> from_a(static_cast<std::size_t>(n)), from_b(static_cast<std::size_t>(n));
  constexpr const char* kHeader = "build,features,ms,gmac_per_s,peak_gmac_per_s,share_of_peak";
  CheckTableIsOurs(options.out / "kernels.csv", kHeader);
  std::string csv = std::string(kHeader) + "\n";
  std::printf("nearest neighbours of %d x %d descriptors on one core, median of %d\n", n, n, kRounds);
  for (const char* name : {"avx512", "avx2", "portable"}) {
    const kernels::Kernel* kernel = kernels::FindKernel(name);
    if (!kernel) {
      std::printf("%-9s not on this processor\n", name);
      continue;
    }
    const kernels::Prepared prepared_a = kernel->prepare(a.data(), n),
                            prepared_b = kernel->prepare(b.data(), n);
    std::vector<double> seconds, peaks;  // taken in turn: both see the same neighbours and clock
    for (int round = 0; round < kRounds; ++round) {
      peaks.push_back(kernel->measure_peak());
      const io::Stopwatch stopwatch;
      kernel->nearest(prepared_a, prepared_b, from_a.data(), from_b.data());
      seconds.push_back(stopwatch.seconds());
    }
    const double s = io::Median(seconds), peak = io::Median(peaks);
    const double rate = double{kernels::kDimensions} * n * n / s;
    std::printf("%-9s %8.2f ms  %6.1f G multiply-adds/s  %3.0f %% of %6.1f G/s\n",
                name,
                1e3 * s,
                rate / 1e9,
                100 * rate / peak,
                peak / 1e9);
    csv += fmt::format(
        "{},{},{:.3f},{:.2f},{:.2f},{:.3f}\n", name, n, 1e3 * s, rate / 1e9, peak / 1e9, rate / peak);
  }
  io::WriteFileAtomically(options.out / "kernels.csv", csv);
}

}  // namespace pipeline
