// One entry point per stage and command; each parses its options, calls one library function and commits the
// outputs. They return the process's exit code and never throw.
#pragma once

namespace pipeline {

int RunIngest(int argc, const char* const* argv);
int RunSfm(int argc, const char* const* argv);
int RunNormalize(int argc, const char* const* argv);
int RunTrain(int argc, const char* const* argv);
int RunEvaluate(int argc, const char* const* argv);
int RunRender(int argc, const char* const* argv);
int RunReport(int argc, const char* const* argv);

int RunAll(int argc, const char* const* argv);     // `pipeline run`
int RunDoctor(int argc, const char* const* argv);  // `pipeline doctor`
int RunBench(int argc, const char* const* argv);   // `pipeline bench`

}  // namespace pipeline
