// `pipeline-torch <stage> ...`: the stages with LibTorch. Users start `pipeline <stage>`, which comes here
// when it must.
#include <cstdio>
#include <cstring>

#include "io/error.h"
#include "nerf/mlp.h"
#include "nerf/torch_mlp.h"
#include "pipeline/stage.h"

namespace {

// For `pipeline doctor`: what is linked, and how fast it is here.
void PrintVersion() {
  const int cores = pipeline::AvailableCores();
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
  for (const pipeline::StageEntry& stage : pipeline::StageTable()) {
    if (argc < 2 || std::strcmp(argv[1], stage.name) != 0) continue;
    nerf::UseTorch();
    return stage.run(argc - 1, argv + 1);
  }
  std::fprintf(stderr, "usage: pipeline-torch STAGE [options]; see pipeline --help\n");
  return static_cast<int>(io::ExitCode::kUsage);
}
