// The stages between pictures and film. Each parses its options, calls one library function and commits the
// outputs; it returns the process's exit code and never throws.
#pragma once

namespace pipeline {

int RunSfm(int argc, const char* const* argv);
int RunNormalize(int argc, const char* const* argv);
int RunTrain(int argc, const char* const* argv);
int RunEvaluate(int argc, const char* const* argv);
int RunRender(int argc, const char* const* argv);

}  // namespace pipeline
