// The command that writes a run in the files of other programs.
#pragma once

namespace pipeline {

// `pipeline export`. Returns the process's exit code and never throws.
int RunExport(int argc, const char* const* argv);

}  // namespace pipeline
