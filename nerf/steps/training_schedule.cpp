#include "nerf/steps/training_schedule.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace nerf {

double TrainingSchedule::LearningRate(double progress) const {
  const double tail = hold < 1 ? std::max(0.0, progress - hold) / (1 - hold) : 0;
  return learning_rate * std::pow(last_rate, tail);
}

double TrainingSchedule::StepScale(double progress) const {
  return std::pow(first_step_scale, 1 - std::min(1.0, progress / step_scale_share));
}

std::string TrainingSchedule::Text() const {
  std::string pixels;
  if (samples_per_pixel_from < 1)
    pixels =
        fmt::format("; {} rays per pixel from {:.0f} % on", samples_per_pixel, 100 * samples_per_pixel_from);
  return fmt::format(
      "tables of 2^{} entries, finest cells of {:g} pixels; moments per {}; rate {:g} for {:.0f} % of the "
      "run, "
      "then falling to {:g}; intervals {:g} times as long at first, 1 after {:.0f} %{}",
      log2_hashmap_size,
      finest_cell_pixels,
      entry_moments ? "entry" : "value",
      learning_rate,
      100 * hold,
      learning_rate * last_rate,
      first_step_scale,
      100 * step_scale_share,
      pixels);
}

TrainingSchedule ScheduleFor(double n_samples) {
  TrainingSchedule schedule;
  if (n_samples < 100e6) {
    schedule = {.log2_hashmap_size = n_samples < 50e6 ? 16 : 17,
                .finest_cell_pixels = 1.4,
                .entry_moments = true,
                .learning_rate = 2e-2,
                .hold = 0.8,
                .last_rate = 0.1,
                .step_scale_share = 0.8,
                .samples_per_pixel_from = 1};
  } else if (n_samples > 140e6) {
    schedule.log2_hashmap_size = n_samples < 300e6 ? 18 : 19;
  }
  return schedule;
}

}  // namespace nerf
