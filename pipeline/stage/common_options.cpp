#include "pipeline/stage/common_options.h"

#include <algorithm>
#include <cstdlib>

#include "io/base/parallel.h"
#include "io/base/ranks.h"

namespace pipeline {
namespace {

constexpr int kMaxThreadsPerCore = 4;  // more only costs memory

}  // namespace

void AddCommonOptions(Options* options, CommonOptions* common) {
  options->Add("out", &common->out, "run folder", {.affects_result = false});
  options->Add(
      "threads", &common->threads, "worker threads; 0 = all cores", {.min = 0, .affects_result = false});
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

}  // namespace pipeline
