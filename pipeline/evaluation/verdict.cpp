#include "pipeline/evaluation/verdict.h"

#include <fmt/format.h>

#include "io/base/median.h"

namespace pipeline {
namespace {

constexpr double kFailedGapDb = 6, kDoubtfulGapDb = 3, kStrayGapDb = 6;
// Above a picture of one colour.
constexpr double kMinGainDb = 3, kSolidGainDb = 10;
// Right scenes hide 3 to 11 % of their points, what stands before them in truth included; a street that was
// memorised as walls before the cameras 31 %.
constexpr double kHiddenPoints = 0.2;

}  // namespace

Verdict Judge(const Scores& scores) {
  Verdict verdict;
  if (scores.views.empty()) return verdict;
  std::vector<double> values;
  for (const ViewScore& view : scores.views) values.push_back(view.psnr_db);
  const double heldout = io::Median(std::move(values));
  for (const std::size_t i : scores.WorstFirst()) {
    const ViewScore& view = scores.views[i];
    if (view.psnr_db <= heldout - kStrayGapDb) verdict.strays.push_back(view.name);
  }
  if (scores.plain_psnr_db && heldout < *scores.plain_psnr_db + kMinGainDb) {
    verdict.outcome = Outcome::kFailed;
    verdict.text =
        fmt::format("held-out views ({:.1f} dB) are hardly better than pictures of one colour ({:.1f} dB)",
                    heldout,
                    *scores.plain_psnr_db);
    return verdict;
  }
  if (!scores.training_psnr_db) return verdict;
  const double training = *scores.training_psnr_db, gap = training - heldout;
  const bool is_solid = scores.plain_psnr_db && heldout >= *scores.plain_psnr_db + kSolidGainDb,
             is_in_place = scores.hidden_points && *scores.hidden_points < kHiddenPoints;
  // Splats make photos that they were fitted to sharper than any field does, and views between them as well.
  if (gap < (is_solid && is_in_place ? kFailedGapDb : kDoubtfulGapDb)) return verdict;
  verdict.outcome = gap < kFailedGapDb || is_solid || is_in_place ? Outcome::kDoubtful : Outcome::kFailed;
  verdict.text = fmt::format(
      "training pictures are {} ({:.1f} dB), the views between them are not shown as well ({:.1f} dB)",
      verdict.outcome == Outcome::kDoubtful ? "fitted" : "memorised",
      training,
      heldout);
  return verdict;
}

}  // namespace pipeline
