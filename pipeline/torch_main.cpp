// `pipeline-torch <stage> ...`: the stages with LibTorch. Users start `pipeline <stage>`, which comes here
// when it must.
#include <cstdio>
#include <cstring>

#include "io/error.h"
#include "nerf/torch_mlp.h"
#include "pipeline/stage.h"

int main(int argc, char** argv) {
  for (const pipeline::StageEntry& stage : pipeline::StageTable()) {
    if (argc < 2 || std::strcmp(argv[1], stage.name) != 0) continue;
    nerf::UseTorch();
    return stage.run(argc - 1, argv + 1);
  }
  std::fprintf(stderr, "usage: pipeline-torch STAGE [options]; see pipeline --help\n");
  return static_cast<int>(io::ExitCode::kUsage);
}
