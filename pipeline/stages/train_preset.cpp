#include "pipeline/stages/train_preset.h"

namespace pipeline {

void ApplyPreset(int argc, const char* const* argv, Options* options, TrainFlags* flags) {
  if (flags->preset.empty()) return;
  options->ApplyPreset(argc, argv, [flags] {
    flags->train = nerf::ReportTrainOptions();
    flags->field = "nerf";
    flags->density = "relu";
    flags->initialisation = "uniform";
    flags->encoding_space = "scene";
    flags->positional_encoding = flags->identity = true;
  });
}

}  // namespace pipeline
