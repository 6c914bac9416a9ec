#include "pipeline/stages.h"
namespace pipeline {
int RunTrain(int, const char* const*) { return 70; }
}  // namespace pipeline
