#include "nerf/training/training_progress.h"

#include <algorithm>

namespace nerf {

double TrainingProgress::At(std::uint64_t step, double elapsed_s) const {
  double progress = steps_ > 0 ? static_cast<double>(step) / steps_ : elapsed_s / time_s_;
  if (ending_)
    progress =
        ending_->progress + (1 - ending_->progress) * (elapsed_s - ending_->begin_s) / ending_->length_s;
  return std::min(progress, 1.0);
}

double TrainingProgress::LeftSeconds(std::uint64_t step, double elapsed_s) const {
  if (ending_) return ending_->begin_s + ending_->length_s - elapsed_s;
  const double progress = At(step, elapsed_s);
  return elapsed_s * (1 - progress) / progress;
}

void TrainingProgress::End(std::uint64_t step, double elapsed_s) {
  const double longest = LeftSeconds(step, elapsed_s);
  ending_ = Ending{
      At(step, elapsed_s), elapsed_s, std::min(std::max(kMinWindDownS, kWindDownShare * elapsed_s), longest)};
}

}  // namespace nerf
