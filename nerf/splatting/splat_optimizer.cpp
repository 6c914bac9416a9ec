#include "nerf/splatting/splat_optimizer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/base/error.h"
#include "io/base/interrupt.h"
#include "io/base/random.h"
#include "nerf/kernels/kernels.h"

namespace nerf {
namespace {

// Adam's rates at the start; all fall evenly in their logarithm to kLastShare of that.
constexpr float kPlaceRate = 0.1f;  // in units of the splat's first size
constexpr float kScaleRate = 0.04f, kRotationRate = 0.02f, kOpacityRate = 0.1f, kColourRate = 0.03f;
constexpr double kLastShare = 0.1;
constexpr float kBeta1 = 0.9f, kBeta2 = 0.99f;
// Splats per task, so that the arrays of a task hold whole vectors.
constexpr std::size_t kSplatsPerTask = 4096;
// Steps that the PSNR shown is the mean of.
constexpr int kShownSteps = 50;

// Values that share a rate, with Adam's moments.
struct Block {
  float rate;
  std::size_t width;  // values per splat
  std::vector<float>*values, *gradients;
  std::vector<float> m = std::vector<float>(values->size()), v = m;
};

class SplatAdam {
 public:
  SplatAdam(int threads, Splats* splats)
      : splats_(splats), first_places_(splats->places), moves_(splats->places.size()), workers_(threads) {
    gradient_.resize(splats->size());
    for (std::size_t i = 0; i < splats->size(); ++i) {
      const float* scales = &splats->log_scales[3 * i];
      sizes_.push_back(std::exp(std::max({scales[0], scales[1], scales[2]})));
    }
    blocks_.push_back({kPlaceRate, 3, &moves_, &gradient_.places});
    blocks_.push_back({kScaleRate, 3, &splats->log_scales, &gradient_.log_scales});
    blocks_.push_back({kRotationRate, 4, &splats->rotations, &gradient_.rotations});
    blocks_.push_back({kOpacityRate, 1, &splats->opacities, &gradient_.opacities});
    blocks_.push_back({kColourRate, 3 * kHarmonics, &splats->colours, &gradient_.colours});
  }

  // Step number `step`, from 0 on. Returns the mean squared error before it.
  double Step(const SplatTarget& target,
              const std::array<float, 3>& background,
              int step,
              double rate_share) {
    const double mse = rasteriser_.Gradient(*splats_, target, background, &gradient_);
    const kernels::AdamStep adam{.learning_rate = static_cast<float>(rate_share),
                                 .beta1 = kBeta1,
                                 .beta2 = kBeta2,
                                 .correction1 = 1 / (1 - std::pow(kBeta1, static_cast<float>(step + 1))),
                                 .correction2 = 1 / (1 - std::pow(kBeta2, static_cast<float>(step + 1)))};
    const std::size_t n = splats_->size(), n_tasks = (n + kSplatsPerTask - 1) / kSplatsPerTask;
    workers_.Run(static_cast<int>(n_tasks), [&](int task, int) {
      const std::size_t begin = static_cast<std::size_t>(task) * kSplatsPerTask;
      Move(adam, begin, std::min(n, begin + kSplatsPerTask));
    });
    return mse;
  }

 private:
  // The splats [begin, end).
  void Move(const kernels::AdamStep& adam, std::size_t begin, std::size_t end) {
    for (std::size_t i = 3 * begin; i < 3 * end; ++i) gradient_.places[i] *= sizes_[i / 3];
    for (Block& block : blocks_) {
      kernels::AdamStep step = adam;
      step.learning_rate *= block.rate;
      const std::size_t at = begin * block.width;
      kernels::ActiveKernels().adam(step,
                                    (end - begin) * block.width,
                                    block.gradients->data() + at,
                                    block.m.data() + at,
                                    block.v.data() + at,
                                    block.values->data() + at,
                                    nullptr);
    }
    for (std::size_t i = 3 * begin; i < 3 * end; ++i)
      splats_->places[i] = first_places_[i] + sizes_[i / 3] * moves_[i];
  }

  Splats* const splats_;
  const std::vector<float> first_places_;
  std::vector<float> sizes_, moves_;  // moves: of the places, in units of the sizes
  Splats gradient_;
  std::vector<Block> blocks_;
  io::Workers workers_;
  SplatRasteriser rasteriser_{&workers_};
};

// The targets in the order of one round.
std::vector<std::size_t> OrderOf(std::size_t n_targets, std::uint64_t seed, std::uint64_t round) {
  std::vector<std::pair<std::uint64_t, std::size_t>> keys;
  for (std::size_t i = 0; i < n_targets; ++i)
    keys.push_back({io::Random(seed, io::Stream::kSplatView, round, i).Bits(), i});
  std::sort(keys.begin(), keys.end());
  std::vector<std::size_t> order;
  for (const auto& [key, i] : keys) order.push_back(i);
  return order;
}

}  // namespace

void OptimizeSplats(const std::vector<SplatTarget>& targets, const SplatOptions& options, Splats* splats) {
  if (targets.empty() || splats->size() == 0) return;
  SplatAdam adam(options.threads, splats);
  std::vector<std::size_t> order;
  double shown_mse = 0;
  for (int step = 0; step < options.steps; ++step) {
    io::ThrowIfInterrupted();
    const std::size_t turn = static_cast<std::size_t>(step) % targets.size();
    if (turn == 0)
      order = OrderOf(targets.size(), options.seed, static_cast<std::size_t>(step) / targets.size());
    io::Random random(options.seed, io::Stream::kSplatBackground, static_cast<std::uint64_t>(step), 0);
    const std::array<float, 3> background = {random.Uniform(), random.Uniform(), random.Uniform()};
    const double rate_share = std::pow(kLastShare, static_cast<double>(step) / options.steps);
    const double mse = adam.Step(targets[order[turn]], background, step, rate_share);
    if (!std::isfinite(mse))
      throw io::Error(io::ExitCode::kNumeric,
                      "fitting splats: the error of step " + std::to_string(step) + " is not finite",
                      "Please report the run's options; --splat-steps 0 goes without");
    shown_mse += (mse - shown_mse) / std::min(step + 1, kShownSteps);
    options.progress(static_cast<double>(step + 1) / options.steps, -10 * std::log10(shown_mse));
  }
}

}  // namespace nerf
