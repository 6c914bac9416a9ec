// What one training run brought, read from its run folder.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "nerf/training/training_curve.h"

namespace pipeline {

struct TrainingResult {
  std::string time;     // the budget as it was asked for: "15s"
  std::string holdout;  // which views were held out: "every" or "sector" (stages/heldout_split.h)
  int seed = 0;
  double psnr_db = 0, ssim = 0;  // of the held-out views
  double steps = 0, train_s = 0, samples_per_s = 0, peak_rss_bytes = 0;
  std::string commit;  // of the program that trained
  nerf::CurveColumns curve;
};

// Adds the figures to `result`. Throws kBadState when the folder lacks the records of `train` and `evaluate`.
void ReadTrainingResult(const std::filesystem::path& run_folder, TrainingResult* result);

// When the held-out PSNR first reached psnr_db: linear between the monitored points, that of the first point
// when it lies above, infinite when none does. seconds: the curve's wall_s or cpu_s.
double SecondsTo(double psnr_db, const std::vector<double>& seconds, const std::vector<double>& psnr);

// The held-out PSNR after wall_s, linear between the monitored points; NaN before the first, the last one's
// after it.
double PsnrAt(double wall_s, const nerf::CurveColumns& curve);

// Of several seeds.
struct Spread {
  double median = 0, low = 0, high = 0;
};
Spread SpreadOf(std::vector<double> values);  // not empty; NaN where one of them is

}  // namespace pipeline
