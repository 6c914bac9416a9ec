#include "pipeline/stages.h"
namespace pipeline {
int RunDoctor(int, const char* const*) { return 70; }
}  // namespace pipeline
