// The last stage: one page with all results.
#pragma once

namespace pipeline {

// `pipeline report`; returns the process's exit code and never throws.
int RunReport(int argc, const char* const* argv);

}  // namespace pipeline
