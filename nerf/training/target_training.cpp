#include "nerf/training/target_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "io/process/ranks.h"

namespace nerf {
namespace {

constexpr double kFirstBudget_s = 5;
// Of Lego between 5 s and 3 minutes; captures gain less and are corrected after two attempts.
constexpr double kFirstSlopeDb = 2.7;
constexpr double kLeastSlopeDb = 0.3;  // noise between short attempts can look like none
constexpr double kMargin = 1.15;       // falling short costs a whole attempt, going beyond ends at the target
constexpr double kLeastGrowth = 1.5, kMostGrowth = 8;

}  // namespace

double NextBudget(const std::vector<Attempt>& attempts, double target_psnr) {
  const Attempt& last = attempts.back();
  double slope = kFirstSlopeDb;
  if (attempts.size() > 1) {
    const Attempt& before = attempts[attempts.size() - 2];
    slope = (last.psnr - before.psnr) / std::log(last.time_s / before.time_s) * std::log(3.0);
  }
  const double growth = std::pow(3.0, (target_psnr - last.psnr) / std::max(slope, kLeastSlopeDb));
  return last.time_s * std::clamp(kMargin * growth, kLeastGrowth, kMostGrowth);
}

TrainReport TrainToTarget(const io::Scene& scene,
                          const io::Scene& heldout,
                          const TrainOptions& options,
                          const std::filesystem::path& folder) {
  if (heldout.frames.empty()) {
    throw io::Error(io::ExitCode::kUsage,
                    "--target: no validation views to measure it on",
                    "Give --time, or at least 10 training pictures");
  }
  TrainOptions attempt = options;
  attempt.time_s = std::min(kFirstBudget_s, options.time_s);
  std::vector<Attempt> attempts;
  std::vector<std::string> events;
  double spent_s = 0;
  std::uint64_t steps = 0;
  for (;;) {
    TrainReport report = Train(scene, heldout, attempt, folder);
    spent_s += report.train_s;
    steps += report.steps;
    events.insert(events.end(), report.events.begin(), report.events.end());
    attempts.push_back({report.budget_s, report.heldout_psnr});
    const bool reached = report.heldout_psnr >= options.target_psnr;
    events.push_back(
        fmt::format("attempt of {:.3g} s: validation views at {:.2f} dB after {:.1f} s, target {:.4g} dB{}",
                    report.budget_s,
                    report.heldout_psnr,
                    report.train_s,
                    options.target_psnr,
                    reached ? " reached" : ""));
    if (reached || report.ended_early || report.budget_s >= options.time_s) {
      report.train_s = spent_s;
      report.steps = steps;
      report.events = std::move(events);
      return report;
    }
    attempt.time_s = std::min(NextBudget(attempts, options.target_psnr), options.time_s);
    if (!io::AllRanks().IsFirst()) continue;
    std::filesystem::remove(folder / "checkpoint.bin");
    std::filesystem::remove(folder / "curve.csv");
  }
}

}  // namespace nerf
