// Fits splats to pictures by Adam, one picture per step. The loss is the mean squared error and a small part
// of the mean opacity.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "nerf/kernels/kernels.h"
#include "nerf/splatting/splat_rasteriser.h"

namespace nerf {

// What the optimiser keeps from step to step.
struct SplatMoments {
  std::vector<float> sizes;  // [n], first largest standard deviations: places move in proportion
  Splats m, v;               // of the gradient and of its square

  bool empty() const { return sizes.empty(); }
};
SplatMoments FirstMoments(const Splats& splats);

class SplatAdam {
 public:
  // All must outlive this.
  SplatAdam(Splats* splats, SplatMoments* moments, io::Workers* workers);

  // Step number `step`, from 0 on. Rates fall with progress, in [0, 1]. Returns the mean squared error before
  // it. Results are the same for any number of threads. Throws kNumeric when the error is not finite.
  double Step(const SplatTarget& target,
              const std::array<float, 3>& background,
              std::uint64_t step,
              double progress);

 private:
  void Move(const kernels::AdamStep& adam, std::size_t begin, std::size_t end);

  Splats* const splats_;
  SplatMoments* const moments_;
  io::Workers* const workers_;
  Splats gradient_;
  std::vector<float> moves_;            // of the places, in units of the sizes
  std::vector<float> most_log_scales_;  // [n]
  SplatRasteriser rasteriser_;
};

// Of fitted splats. Throws kNumeric: a value that is not finite can take its splat out of every picture, and
// so out of the errors of all steps.
void RequireFinite(const Splats& splats);

// Which of n targets a step takes: all of them in a new order each round.
std::size_t SplatTurn(std::size_t n_targets, std::uint64_t seed, std::uint64_t step);
// The background of a step, another each time, so that what is transparent stays so.
std::array<float, 3> SplatBackground(std::uint64_t seed, std::uint64_t step);

struct SplatOptions {
  int steps = 1000;
  std::uint64_t seed = 0;
  int threads = 1;
  // Called after each step with the share of the work done and the PSNR of the last pictures [dB].
  std::function<void(double share, double psnr_db)> progress = [](double, double) {};
};

// The same seed gives the same bytes for any number of threads. Throws io::Interrupted.
void OptimizeSplats(const std::vector<SplatTarget>& targets, const SplatOptions& options, Splats* splats);

}  // namespace nerf
