// Programs start without LibTorch, which takes 0.4 s and 160 MB to load; `pipeline-torch <stage> ...` is the
// one that has it, for the `nerf` field.
#pragma once

#include <filesystem>
#include <string>

namespace pipeline {

// Whether the checkpoint holds a `nerf` field. False when there is none: the stage then says which to run
// first. Throws kBadState when it is damaged.
bool NeedsTorch(const std::filesystem::path& checkpoint);

// Returns when this process has LibTorch. Else replaces it by `pipeline-torch`, with the same arguments, or
// throws kMissingTool when that is not beside it.
void ContinueWithTorch(const std::string& stage, int argc, const char* const* argv);

}  // namespace pipeline
