#include "nerf/splatting/splat_optimizer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/base/error.h"
#include "io/base/random.h"
#include "io/process/interrupt.h"

namespace nerf {
namespace {

// Adam's rates at the start; all fall evenly in their logarithm to kLastShare of that.
constexpr float kPlaceRate = 0.1f;  // in units of the splat's first size
constexpr float kScaleRate = 0.12f, kRotationRate = 0.02f, kOpacityRate = 0.2f, kColourRate = 0.03f;
constexpr double kLastShare = 0.1;
// Standard deviations in units of the splat's first size. Larger ones, grown where few photos look, would
// veil whole pictures from between the photos.
constexpr float kMostGrowth = 10;
// Structure: edges count more than even brightness, which the field shows well already. Opacity: splats that
// photos hardly ask for fade, instead of learning single photos by heart (Kheradmand et al. 2024).
constexpr SplatLossWeights kWeights = {.structure = 0.02f, .opacity = 1e-3f};
constexpr float kBeta1 = 0.8f, kBeta2 = 0.99f;
// Splats per task, so that the arrays of a task hold whole vectors.
constexpr std::size_t kSplatsPerTask = 4096;
// Steps that the PSNR shown is the mean of.
constexpr int kShownSteps = 50;

constexpr const char* kRemedy =
    "Please report the run's options; --no-splats (train) or --splat-steps 0 (export) go without";

// Values that share a rate.
struct Block {
  float rate;
  std::size_t width;  // values per splat
  std::vector<float>*values, *gradients, *m, *v;
};

}  // namespace

SplatMoments FirstMoments(const Splats& splats) {
  SplatMoments moments;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const float* scales = &splats.log_scales[3 * i];
    moments.sizes.push_back(std::exp(std::max({scales[0], scales[1], scales[2]})));
  }
  moments.m.resize(splats.size()), moments.v.resize(splats.size());
  return moments;
}

SplatAdam::SplatAdam(Splats* splats, SplatMoments* moments, io::Workers* workers)
    : splats_(splats),
      moments_(moments),
      workers_(workers),
      moves_(splats->places.size()),
      rasteriser_(workers) {
  gradient_.resize(splats->size());
  for (const float size : moments->sizes) most_log_scales_.push_back(std::log(kMostGrowth * size));
}

double SplatAdam::Step(const SplatTarget& target,
                       const std::array<float, 3>& background,
                       std::uint64_t step,
                       double progress) {
  const double mse = rasteriser_.Gradient(*splats_, target, background, kWeights, &gradient_);
  if (!std::isfinite(mse))
    throw io::Error(io::ExitCode::kNumeric,
                    "fitting splats: the error of step " + std::to_string(step) + " is not finite",
                    kRemedy);
  const auto n_steps = static_cast<float>(step + 1);
  const kernels::AdamStep adam{.learning_rate = static_cast<float>(std::pow(kLastShare, progress)),
                               .beta1 = kBeta1,
                               .beta2 = kBeta2,
                               .correction1 = 1 / (1 - std::pow(kBeta1, n_steps)),
                               .correction2 = 1 / (1 - std::pow(kBeta2, n_steps))};
  const std::size_t n = splats_->size(), n_tasks = (n + kSplatsPerTask - 1) / kSplatsPerTask;
  workers_->Run(static_cast<int>(n_tasks), [&](int task, int) {
    const std::size_t begin = static_cast<std::size_t>(task) * kSplatsPerTask;
    Move(adam, begin, std::min(n, begin + kSplatsPerTask));
  });
  return mse;
}

// The splats [begin, end).
void SplatAdam::Move(const kernels::AdamStep& adam, std::size_t begin, std::size_t end) {
  Splats &splats = *splats_, &g = gradient_, &m = moments_->m, &v = moments_->v;
  const std::vector<float>& sizes = moments_->sizes;
  for (std::size_t i = 3 * begin; i < 3 * end; ++i) {
    g.places[i] *= sizes[i / 3];
    moves_[i] = 0;
  }
  const Block blocks[] = {{kPlaceRate, 3, &moves_, &g.places, &m.places, &v.places},
                          {kScaleRate, 3, &splats.log_scales, &g.log_scales, &m.log_scales, &v.log_scales},
                          {kRotationRate, 4, &splats.rotations, &g.rotations, &m.rotations, &v.rotations},
                          {kOpacityRate, 1, &splats.opacities, &g.opacities, &m.opacities, &v.opacities},
                          {kColourRate, 3 * kHarmonics, &splats.colours, &g.colours, &m.colours, &v.colours}};
  for (const Block& block : blocks) {
    kernels::AdamStep step = adam;
    step.learning_rate *= block.rate;
    const std::size_t at = begin * block.width;
    kernels::ActiveKernels().adam(step,
                                  (end - begin) * block.width,
                                  block.gradients->data() + at,
                                  block.m->data() + at,
                                  block.v->data() + at,
                                  block.values->data() + at,
                                  nullptr);
  }
  for (std::size_t i = 3 * begin; i < 3 * end; ++i) {
    splats.places[i] += sizes[i / 3] * moves_[i];
    splats.log_scales[i] = std::min(splats.log_scales[i], most_log_scales_[i / 3]);
  }
}

void RequireFinite(const Splats& splats) {
  for (const auto* values :
       {&splats.places, &splats.log_scales, &splats.rotations, &splats.opacities, &splats.colours}) {
    if (!std::all_of(values->begin(), values->end(), [](float value) { return std::isfinite(value); }))
      throw io::Error(io::ExitCode::kNumeric, "fitting splats: a value is not finite", kRemedy);
  }
}

std::size_t SplatTurn(std::size_t n_targets, std::uint64_t seed, std::uint64_t step) {
  std::vector<std::pair<std::uint64_t, std::size_t>> keys;
  for (std::size_t i = 0; i < n_targets; ++i)
    keys.push_back({io::Random(seed, io::Stream::kSplatView, step / n_targets, i).Bits(), i});
  const auto turn = keys.begin() + static_cast<std::ptrdiff_t>(step % n_targets);
  std::nth_element(keys.begin(), turn, keys.end());
  return turn->second;
}

std::array<float, 3> SplatBackground(std::uint64_t seed, std::uint64_t step) {
  io::Random random(seed, io::Stream::kSplatBackground, step, 0);
  return {random.Uniform(), random.Uniform(), random.Uniform()};
}

void OptimizeSplats(const std::vector<SplatTarget>& targets, const SplatOptions& options, Splats* splats) {
  if (targets.empty() || splats->size() == 0) return;
  io::Workers workers(options.threads);
  SplatMoments moments = FirstMoments(*splats);
  SplatAdam adam(splats, &moments, &workers);
  double shown_mse = 0;
  for (int i = 0; i < options.steps; ++i) {
    io::ThrowIfInterrupted();
    const auto step = static_cast<std::uint64_t>(i);
    const double mse = adam.Step(targets[SplatTurn(targets.size(), options.seed, step)],
                                 SplatBackground(options.seed, step),
                                 step,
                                 static_cast<double>(i) / options.steps);
    shown_mse += (mse - shown_mse) / std::min(i + 1, kShownSteps);
    options.progress(static_cast<double>(i + 1) / options.steps, -10 * std::log10(shown_mse));
  }
  RequireFinite(*splats);
}

}  // namespace nerf
