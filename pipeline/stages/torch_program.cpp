#include "pipeline/stages/torch_program.h"

#include "nerf/fields/checkpoint.h"
#include "nerf/fields/mlp.h"
#include "pipeline/stages/program_change.h"

namespace pipeline {

bool NeedsTorch(const std::filesystem::path& checkpoint) {
  return std::filesystem::exists(checkpoint) && nerf::KindOfCheckpoint(checkpoint) == nerf::FieldKind::kMlp;
}

void ContinueWithTorch(const std::string& stage, int argc, const char* const* argv) {
  if (nerf::HasMlpFactory()) return;
  ContinueIn("pipeline-torch", stage, argc, argv);
}

}  // namespace pipeline
