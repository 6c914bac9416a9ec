#include "pipeline/stages.h"
namespace pipeline {
int RunIngest(int, const char* const*) { return 70; }
}  // namespace pipeline
