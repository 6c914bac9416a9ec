#include "pipeline/stages.h"
namespace pipeline {
int RunAll(int, const char* const*) { return 70; }
}  // namespace pipeline
