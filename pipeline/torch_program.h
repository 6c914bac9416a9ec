// Programs start without LibTorch, which takes 0.4 s and 160 MB to load; `pipeline-torch <stage> ...` is the
// one that has it, for the `nerf` field.
#pragma once

#include <string>

namespace pipeline {

// Returns when this process has LibTorch. Else replaces it by `pipeline-torch`, with the same arguments, or
// throws kMissingTool when that is not beside it.
void ContinueWithTorch(const std::string& stage, int argc, const char* const* argv);

}  // namespace pipeline
