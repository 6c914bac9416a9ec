// Fits splats to pictures by Adam, one picture per step.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "nerf/splatting/splat_rasteriser.h"

namespace nerf {

struct SplatOptions {
  int steps = 1000;
  std::uint64_t seed = 0;
  int threads = 1;
  // Called after each step with the share of the work done and the PSNR of the last pictures [dB].
  std::function<void(double share, double psnr_db)> progress = [](double, double) {};
};

// Targets are seen in a new order each round, before changing backgrounds, so that what is transparent stays
// so. Every place moves in proportion to its splat's first size. The same seed gives the same bytes for any
// number of threads. Throws io::Interrupted.
void OptimizeSplats(const std::vector<SplatTarget>& targets, const SplatOptions& options, Splats* splats);

}  // namespace nerf
