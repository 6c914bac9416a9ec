// A stage on several ranks. torchrun, srun or a person starts the same command once per rank, with RANK,
// WORLD_SIZE, MASTER_ADDR and MASTER_PORT in the environment and a run folder that all can reach; WORLD_SIZE
// above 1 makes `pipeline <stage>` continue in `pipeline-ranks`, the program that can join them.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "io/process/ranks.h"

namespace pipeline {

class RankSession {
 public:
  // With one rank, does nothing. Else returns when all ranks are there; io::AllRanks() are then those of the
  // environment until this is destroyed, and kernels are the best that the processors of all have. To be
  // called before anything computes. Replaces the process where it cannot join.
  RankSession(const std::string& stage, const std::filesystem::path& out, int argc, const char* const* argv);
  // While an exception is on its way this rank counts as failed.
  ~RankSession();
  RankSession(const RankSession&) = delete;
  RankSession& operator=(const RankSession&) = delete;

 private:
  std::unique_ptr<io::Ranks> before_;  // null: one rank
  const int exceptions_;
};

}  // namespace pipeline
