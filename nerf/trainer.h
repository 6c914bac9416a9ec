// Trains the `hash` field on a scene within a time budget or for a number of steps.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "io/scene.h"
#include "nerf/scene_field.h"
#include "nerf/training_curve.h"

namespace nerf {

struct TrainOptions {
  double time_s = 180;  // training budget in seconds; schedules follow the share of it that is used
  int steps = 0;  // > 0: this many steps instead; the result then depends on nothing but seed and inputs
  std::uint64_t seed = 1;
  int threads = 1;
  int samples_per_step = 1 << 16;     // target; the number of rays follows from the samples they meet
  double learning_rate = 1e-2;        // Adam, tables and networks; held, then falling exponentially
  double learning_rate_hold = 0.4;    // share of the run
  double learning_rate_final = 0.02;  // last rate / first rate
  double first_step_scale = 2.5;      // sampling intervals start this much longer ...
  double step_scale_share = 0.3;      // ... and shrink to 1 within this share of the run
  double checkpoint_every_s = 60;
  SceneFieldOptions field;
};

struct TrainReport {
  std::uint64_t steps = 0;
  std::size_t parameters = 0;
  double train_s = 0;  // without monitoring and checkpoints
  double samples_per_s = 0, rays_per_s = 0, samples_per_ray = 0;
  double heldout_psnr = 0;  // last monitored value; NaN without held-out pictures
  double occupied_share = 0;
  int skipped_steps = 0, restarts = 0;
  std::string derivation, kernels;
  std::vector<std::string> events;  // resume, restart, skipped steps
  std::vector<CurvePoint> curve;
};

// Writes checkpoint.bin and curve.csv into `folder`; continues from them when they are there. heldout may
// have no frames. On a pending interrupt it writes a checkpoint and throws io::Interrupted. Throws kNumeric
// when the loss stays non-finite, naming step, ray and seed.
TrainReport Train(const io::Scene& scene,
                  const io::Scene& heldout,
                  const TrainOptions& options,
                  const std::filesystem::path& folder);

}  // namespace nerf
