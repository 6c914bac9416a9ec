// Options that every stage has.
#pragma once

#include <filesystem>

#include "pipeline/stage/options.h"

namespace pipeline {

struct CommonOptions {
  std::filesystem::path out;  // run folder; empty: not given
  bool force = false;         // run even when nothing changed
  int threads = 0;            // 0: all cores
};
void AddCommonOptions(Options* options, CommonOptions* common);
// common.threads, or all available cores for 0; never more than four threads per core.
int ResolvedThreads(const CommonOptions& common);

}  // namespace pipeline
