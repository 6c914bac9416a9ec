#include "pipeline/ranks/ranks.h"

#include <cstdio>
#include <cstring>

#include "io/base/error.h"
#include "io/process/meeting.h"
#include "nerf/fields/torch_mlp.h"
#include "nerf/ranks/gloo_ranks.h"
#include "pipeline/command/commands.h"
#include "pipeline/stages/stages.h"

namespace pipeline {
namespace {

struct Stage {
  const char* name;
  int (*run)(int argc, const char* const* argv);
};
constexpr Stage kStages[] = {
    {"run", RunRun}, {"sfm", RunSfm}, {"train", RunTrain}, {"evaluate", RunEvaluate}, {"render", RunRender}};

}  // namespace

int RunRanks(int argc, const char* const* argv) {
  nerf::UseTorch();
  io::Join() = nerf::JoinByGloo;
  for (const Stage& stage : kStages) {
    if (argc >= 2 && std::strcmp(argv[1], stage.name) == 0) return stage.run(argc - 1, argv + 1);
  }
  std::fprintf(stderr, "usage: pipeline-ranks STAGE [options]; see pipeline --help\n");
  return static_cast<int>(io::ExitCode::kUsage);
}

}  // namespace pipeline
