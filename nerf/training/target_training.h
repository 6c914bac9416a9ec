// Training to a quality instead of for a time: attempts with growing budgets, each with the schedule that is
// best for its budget, until validation views reach the target.
#pragma once

#include <filesystem>

#include "nerf/training/trainer.h"

namespace nerf {

struct Attempt {
  double time_s, psnr;
};

// Budget of the next attempt. Quality grows about linearly with the logarithm of the time: from the last two
// attempts, or 2.7 dB per factor 3 after one. At least 1.5 times and at most 8 times the last one.
double NextBudget(const std::vector<Attempt>& attempts, double target_psnr);

// As Train, until the monitored PSNR of `heldout`, the validation views, reaches options.target_psnr or an
// attempt of options.time_s is over. The report is the last attempt's, with the steps and the time of all. A
// resumed run continues its attempt and counts from that on. Throws kUsage without validation views.
TrainReport TrainToTarget(const io::Scene& scene,
                          const io::Scene& heldout,
                          const TrainOptions& options,
                          const std::filesystem::path& folder);

}  // namespace nerf
