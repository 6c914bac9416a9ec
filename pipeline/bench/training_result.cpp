#include "pipeline/bench/training_result.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/median.h"
#include "pipeline/stage/run_record.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Json;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Json ReadRecord(const fs::path& run_folder, const std::string& stage) {
  Json record = ReadStageRecord(run_folder, stage);
  if (record.is_object()) return record;
  throw io::Error(io::ExitCode::kBadState,
                  run_folder.string() + ": has no valid record of `" + stage + "`",
                  "Remove the folder and repeat the command");
}

}  // namespace

void ReadTrainingResult(const fs::path& run_folder, TrainingResult* result) {
  const Json train = ReadRecord(run_folder, "train"), evaluate = ReadRecord(run_folder, "evaluate");
  result->psnr_db = NumberAt(evaluate, "psnr", kNan);
  result->ssim = NumberAt(evaluate, "ssim", kNan);
  result->steps = NumberAt(train, "steps", kNan);
  result->train_s = NumberAt(train, "train_s", kNan);
  result->samples_per_s = NumberAt(train, "samples_per_s", kNan);
  result->peak_rss_bytes = NumberAt(train, "peak_rss_bytes", kNan);
  const auto versions = train.find("versions");
  result->commit = versions != train.end() ? TextAt(*versions, "commit") : "";
  result->curve = nerf::ReadTrainingCurve(run_folder / "train" / "curve.csv");
}

double SecondsTo(double psnr_db, const std::vector<double>& seconds, const std::vector<double>& psnr) {
  for (std::size_t i = 0; i < psnr.size(); ++i) {
    if (!(psnr[i] >= psnr_db)) continue;
    if (i == 0 || !std::isfinite(psnr[i - 1])) return seconds[i];
    const double share = (psnr_db - psnr[i - 1]) / (psnr[i] - psnr[i - 1]);
    return std::lerp(seconds[i - 1], seconds[i], share);
  }
  return std::numeric_limits<double>::infinity();
}

double PsnrAt(double wall_s, const nerf::CurveColumns& curve) {
  const std::vector<double>& at = curve.wall_s;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (at[i] == wall_s) return curve.heldout_psnr[i];
    if (at[i] < wall_s) continue;
    if (i == 0) break;
    const double share = (wall_s - at[i - 1]) / (at[i] - at[i - 1]);
    return std::lerp(curve.heldout_psnr[i - 1], curve.heldout_psnr[i], share);
  }
  const bool is_over = !at.empty() && at.back() < wall_s;
  return is_over ? curve.heldout_psnr.back() : kNan;
}

Spread SpreadOf(std::vector<double> values) {
  if (std::any_of(values.begin(), values.end(), [](double v) { return std::isnan(v); }))
    return {kNan, kNan, kNan};
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return {io::MeanMedian(values), *low, *high};
}

}  // namespace pipeline
