// `pipeline-ranks <stage> ...`: the programs that share their work out over several ranks. Users start
// `pipeline <stage>` or `pipeline run`, which come here when WORLD_SIZE says that there are several.
#pragma once

namespace pipeline {

// Returns the process's exit code and never throws.
int RunRanks(int argc, const char* const* argv);

}  // namespace pipeline
