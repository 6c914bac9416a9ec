#include "pipeline/stages.h"
namespace pipeline {
int RunEvaluate(int, const char* const*) { return 70; }
}  // namespace pipeline
