// The command that shows a run.
#pragma once

namespace pipeline {

// `pipeline view`. Returns the process's exit code and never throws.
int RunView(int argc, const char* const* argv);

}  // namespace pipeline
