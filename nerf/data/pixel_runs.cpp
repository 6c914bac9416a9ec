#include "nerf/data/pixel_runs.h"

namespace nerf {

PixelRuns::PixelRuns(std::vector<PixelRun> runs) : runs_(std::move(runs)) {
  for (std::size_t rank = 0, run = 0; rank < size(); rank += kBlock) {
    while (runs_[run + 1].first_rank <= rank) ++run;
    run_of_block_.push_back(static_cast<std::uint32_t>(run));
  }
}

}  // namespace nerf
