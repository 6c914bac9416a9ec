// What is known of a training once it is over.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/image/mask.h"
#include "nerf/steps/moved_camera.h"
#include "nerf/training/training_curve.h"

namespace nerf {

struct TrainReport {
  std::uint64_t steps = 0;
  std::size_t parameters = 0;
  double budget_s = 0;  // that the schedule was made for; with target_psnr that of the resumed run
  double train_s = 0;   // without monitoring and checkpoints
  double samples_per_s = 0, rays_per_s = 0, samples_per_ray = 0;
  double heldout_psnr = 0;  // last monitored value; NaN without held-out pictures
  double occupied_share = 0;
  int skipped_steps = 0, restarts = 0;
  bool ended_early = false;  // because a watcher asked for it
  // `nerf`: rate of the network's arithmetic over the whole training, and the machine's rate of such
  // products.
  double gflops = 0, gemm_gflops = 0;
  std::string derivation;
  std::string arithmetic;           // "avx512 kernels", "LibTorch 1.13.0 (CPU), bf16"
  std::vector<std::string> events;  // resume, restart, skipped steps
  std::vector<CurvePoint> curve;
  std::vector<MovedCamera> moved_cameras;
  std::vector<io::Mask> masks;  // TransientMasks::Masks
};

}  // namespace nerf
