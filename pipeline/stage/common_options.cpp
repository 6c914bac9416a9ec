#include "pipeline/stage/common_options.h"

#include <algorithm>

#include "io/base/parallel.h"

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
  const int cores = io::AvailableCores();
  return common.threads == 0 ? cores : std::min(common.threads, kMaxThreadsPerCore * cores);
}

}  // namespace pipeline
