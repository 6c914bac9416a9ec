#include "pipeline/stages.h"
namespace pipeline {
int RunReport(int, const char* const*) { return 70; }
}  // namespace pipeline
