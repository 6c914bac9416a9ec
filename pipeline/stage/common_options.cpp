#include "pipeline/stage/common_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include "io/base/error.h"
#include "io/process/parallel.h"
#include "io/process/ranks.h"

namespace pipeline {
namespace {

constexpr int kMaxThreadsPerCore = 4;  // more only costs memory
// Less holds no stage's libraries; more is a typing error.
constexpr double kMinMemory = 1 << 26, kMaxMemory = 1ull << 50;

}  // namespace

void AddCommonOptions(Options* options, CommonOptions* common, bool needs_out) {
  options->Add(
      "out", &common->out, "run folder", {.affects_result = false, .required = needs_out ? "DIR" : ""});
  options->Add(
      "threads", &common->threads, "worker threads; 0 = all cores", {.min = 0, .affects_result = false});
  options->Add("memory",
               &common->memory,
               "most memory that a stage takes, such as 2G or 800M; less is done at once, and what cannot be "
               "done within is refused at the start; default: what the machine has free",
               {.check = ParseBytes, .affects_result = false});
  options->Add("force", &common->force, "run again even when nothing changed", {.affects_result = false});
}

int ResolvedThreads(const CommonOptions& common) {
  int cores = io::AvailableCores();
  // torchrun says how many ranks share this machine; srun gives each its own cores.
  const char* ranks_here = std::getenv("LOCAL_WORLD_SIZE");
  if (io::AllRanks().AreSeveral() && ranks_here)
    cores = std::max(1, cores / std::max(1, std::atoi(ranks_here)));
  return common.threads == 0 ? cores : std::min(common.threads, kMaxThreadsPerCore * cores);
}

io::MemoryBudget ResolvedMemory(const CommonOptions& common) {
  if (common.memory.empty()) return io::MemoryBudget(io::HeldMemoryBytes() + io::FreeMemoryBytes());
  const io::MemoryBudget budget(ParseBytes("memory", common.memory));
  io::LimitMemory(budget, ResolvedThreads(common));
  return budget;
}

std::size_t ParseBytes(const std::string& option_name, const std::string& text) {
  double number = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number);
  const std::string unit(error == std::errc() ? end : last, last);
  const double unit_bytes = unit == "G" || unit == "GB" || unit == "GiB"   ? 1 << 30
                            : unit == "M" || unit == "MB" || unit == "MiB" ? 1 << 20
                                                                           : 0;
  const double bytes = number * unit_bytes;
  if (!(bytes >= kMinMemory && bytes <= kMaxMemory)) {
    throw io::Error(io::ExitCode::kUsage,
                    "--" + option_name + ": '" + text + "' is not an amount of memory of 64M or more",
                    "Write for example 2G or 800M");
  }
  return static_cast<std::size_t>(bytes);
}

}  // namespace pipeline
