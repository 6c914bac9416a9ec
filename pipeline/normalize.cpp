#include "pipeline/stages.h"
namespace pipeline {
int RunNormalize(int, const char* const*) { return 70; }
}  // namespace pipeline
