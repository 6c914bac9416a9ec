// Options that every stage has.
#pragma once

#include <filesystem>
#include <string>

#include "io/base/memory.h"
#include "pipeline/stage/options.h"

namespace pipeline {

struct CommonOptions {
  std::filesystem::path out;  // run folder; empty: not given
  bool force = false;         // run even when nothing changed
  int threads = 0;            // 0: all cores
  std::string memory;         // of each stage, such as 2G; empty: what the machine has free
};
void AddCommonOptions(Options* options, CommonOptions* common, bool needs_out = true);
// common.threads, or all available cores for 0; never more than four threads per core.
int ResolvedThreads(const CommonOptions& common);
// What this process may take: common.memory, which is then also enforced, or what the machine has free.
io::MemoryBudget ResolvedMemory(const CommonOptions& common);

// Bytes from "2G", "1.5G", "800M" (powers of 1024; "GB", "GiB", "MB" and "MiB" are read alike). Throws kUsage
// naming the option.
std::size_t ParseBytes(const std::string& option_name, const std::string& text);

}  // namespace pipeline
