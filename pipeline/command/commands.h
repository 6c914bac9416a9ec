// The commands that concern a whole run. They return the process's exit code and never throw.
#pragma once

namespace pipeline {

int RunRun(int argc, const char* const* argv);     // `pipeline run`
int RunDoctor(int argc, const char* const* argv);  // `pipeline doctor`

}  // namespace pipeline
