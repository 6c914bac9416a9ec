// `pipeline bench kernels`: the kernels of the `hash` field against what the machine can do at most, and
// SSIM.
#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/process/interrupt.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/bench_table.h"
#include "pipeline/bench/kernel_cases.h"
#include "pipeline/report/bar_plot.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;

const std::vector<std::string> kBuilds = {"portable", "avx2", "avx512", "avx512bf16"};

// "all": those that this processor runs. Throws kUsage for an unknown one, kMissingTool for one that it
// lacks.
std::vector<std::string> ChooseBuilds(const std::string& text) {
  std::vector<std::string> chosen;
  const bool all = text == "all";
  for (const std::string& name : all ? kBuilds : SplitList(text)) {
    if (std::find(kBuilds.begin(), kBuilds.end(), name) == kBuilds.end()) {
      throw Error(ExitCode::kUsage,
                  "--builds: '" + name + "' is unknown",
                  "Known: all, portable, avx2, avx512, avx512bf16");
    }
    if (nerf::kernels::FindKernels(name.c_str())) {
      chosen.push_back(name);
    } else if (!all) {
      throw Error(ExitCode::kMissingTool, "--builds: this processor lacks " + name, "Give --builds all");
    }
  }
  if (chosen.empty()) throw Error(ExitCode::kUsage, "--builds: names no build", "Give --builds all");
  return chosen;
}

// Rates of the limits by name; NaN for none.
class Limits {
 public:
  explicit Limits(const std::vector<KernelCase>& cases) {
    for (const KernelCase& c : cases) {
      if (c.limit.empty()) rates_[c.Name()] = c.Rate();
    }
  }
  double RateFor(const KernelCase& c) const {
    return c.limit.empty() ? std::numeric_limits<double>::quiet_NaN() : rates_.at(c.limit);
  }
  double SharePercent(const KernelCase& c) const { return 100 * c.Rate() / RateFor(c); }

 private:
  std::map<std::string, double> rates_;
};

void PrintCases(const std::vector<KernelCase>& cases, const Limits& limits) {
  std::printf("%-10s %-22s %-6s %10s %-10s %9s %-12s %9s %6s\n",
              "build",
              "kernel",
              "format",
              "ns",
              "per",
              "rate",
              "unit",
              "limit",
              "%");
  for (const KernelCase& c : cases) {
    std::printf("%-10s %-22s %-6s %10.4f %-10s %9.2f %-12s",
                c.build.c_str(),
                c.kernel.c_str(),
                c.format.c_str(),
                c.NanosecondsPerItem(),
                c.item.c_str(),
                c.Rate(),
                c.unit.c_str());
    if (!c.limit.empty()) std::printf(" %9.2f %6.1f", limits.RateFor(c), limits.SharePercent(c));
    std::printf("\n");
  }
}

std::vector<BenchValue> ToValues(const std::vector<KernelCase>& cases, const Limits& limits) {
  std::vector<BenchValue> values;
  for (const KernelCase& c : cases) {
    const std::string parameters = "build=" + c.build + " format=" + c.format;
    values.push_back({c.kernel, parameters, "time", "ns/" + c.item, c.NanosecondsPerItem()});
    values.push_back({c.kernel, parameters, "rate", c.unit, c.Rate()});
    if (c.limit.empty()) continue;
    values.push_back({c.kernel, parameters, "limit: " + c.limit, c.unit, limits.RateFor(c)});
    values.push_back({c.kernel, parameters, "share of limit", "%", limits.SharePercent(c)});
  }
  return values;
}

// A row per kernel and format, a bar per build.
std::string Plot(const std::vector<KernelCase>& cases,
                 const Limits& limits,
                 const std::vector<std::string>& builds) {
  BarPlot plot{.title = "% of the limit", .series = builds};
  std::map<std::string, std::size_t> rows;
  for (const KernelCase& c : cases) {
    if (c.limit.empty()) continue;
    const std::string label = c.kernel + " " + c.format;
    const auto [row, is_new] = rows.emplace(label, plot.groups.size());
    if (is_new) {
      plot.groups.push_back(
          {label, std::vector<double>(builds.size(), std::numeric_limits<double>::quiet_NaN())});
    }
    const auto build = std::find(builds.begin(), builds.end(), c.build) - builds.begin();
    plot.groups[row->second].values[static_cast<std::size_t>(build)] = limits.SharePercent(c);
  }
  return BarPlotSvg(plot);
}

void RunFieldKernels(const std::filesystem::path& out, const std::vector<std::string>& builds, int rounds) {
  const std::filesystem::path csv = out / "kernels.csv";
  CheckTableIsOurs(csv, kBenchTableHeader);  // before the work
  io::ClaimFolder(out);
  KernelData data;
  std::vector<KernelCase> cases = LimitCases(builds, &data);
  for (const std::string& build : builds) {
    for (KernelCase& c : FieldKernelCases(build, &data)) cases.push_back(std::move(c));
  }
  cases.push_back(SsimCase(&data));
  std::printf("%s; one thread, best of %d rounds of its processor time\n", BenchMachine().c_str(), rounds);
  // Round by round through all cases: limits and kernels see the same neighbours and the same clock.
  for (int round = 0; round < rounds; ++round) {
    for (KernelCase& c : cases) {
      io::ThrowIfInterrupted();
      Measure(&c);
    }
  }
  const Limits limits(cases);
  PrintCases(cases, limits);
  WriteBenchTable(csv, ToValues(cases, limits));
  io::WriteFileAtomically(out / "kernels.svg", Plot(cases, limits, builds));
}

}  // namespace

int RunBenchKernels(int argc, const char* const* argv) {
  return GuardedMain("pipeline bench kernels", [&] {
    std::filesystem::path out;
    std::string builds = "all";
    int rounds = 15;
    Options options(
        "pipeline bench kernels",
        "Times the kernels of the `hash` field on one thread, on the working sets of training, and beside\n"
        "them what this machine can do at most: arithmetic on registers, and random and sequential\n"
        "accesses to as much memory as the kernel works on; and SSIM. Times are processor time, best of\n"
        "several rounds, since other jobs may run. Writes kernels.csv and kernels.svg.");
    options.Add("out", &out, "folder for kernels.csv and kernels.svg", {.required = "DIR"});
    options.Add("builds", &builds, "portable, avx2, avx512, avx512bf16; all = all that this processor runs");
    options.Add("rounds", &rounds, "measurements of each kernel; the best counts", {.min = 1});
    if (!options.Parse(argc, argv)) return;
    RunFieldKernels(out, ChooseBuilds(builds), rounds);
  });
}

}  // namespace pipeline
