// Programs are small: what few runs need, such as LibTorch, lives in programs of its own, in which a stage
// continues.
#pragma once

#include <string>

namespace pipeline {

// Replaces this process by `<program> <stage> ...` with the same arguments. Throws kMissingTool when it is
// not beside the running one.
[[noreturn]] void ContinueIn(const std::string& program,
                             const std::string& stage,
                             int argc,
                             const char* const* argv);

}  // namespace pipeline
