// `pipeline-torch <stage> ...`: the programs that render, with LibTorch. Users start `pipeline <stage>`,
// which comes here when it must.
#include <cstdio>
#include <cstring>

#include "io/base/error.h"
#include "io/process/parallel.h"
#include "nerf/fields/mlp.h"
#include "nerf/fields/torch_mlp.h"
#include "pipeline/export/export.h"
#include "pipeline/stages/stages.h"

namespace {

struct Stage {
  const char* name;
  int (*run)(int argc, const char* const* argv);
};
constexpr Stage kStages[] = {{"train", pipeline::RunTrain},
                             {"evaluate", pipeline::RunEvaluate},
                             {"render", pipeline::RunRender},
                             {"export", pipeline::RunExport}};

// For `pipeline doctor`: what is linked, and how fast it is here.
void PrintVersion() {
  const int cores = io::AvailableCores();
  nerf::MlpOptions options;
  std::printf(
      "%s: products of float %.0f", nerf::TorchVersion().c_str(), nerf::MakeMlp(options)->MeasureGemm(cores));
  options.bf16 = true;
  std::printf(", of bfloat16 %.0f GFLOP/s\n", nerf::MakeMlp(options)->MeasureGemm(cores));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--version") == 0) {
    nerf::UseTorch();
    PrintVersion();
    return 0;
  }
  for (const Stage& stage : kStages) {
    if (argc < 2 || std::strcmp(argv[1], stage.name) != 0) continue;
    nerf::UseTorch();
    return stage.run(argc - 1, argv + 1);
  }
  std::fprintf(stderr, "usage: pipeline-torch STAGE [options]; see pipeline --help\n");
  return static_cast<int>(io::ExitCode::kUsage);
}
