// Runs independent rows of work on several threads. Results must not depend on the order: each row writes
// only its own.
#pragma once

#include <functional>

namespace samples {

// Calls row(0) ... row(count - 1), each once. Stops early and rethrows when a row throws.
void ParallelRows(int count, int threads, const std::function<void(int)>& row);

}  // namespace samples
