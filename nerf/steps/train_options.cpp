#include "nerf/steps/train_options.h"

namespace nerf {

TrainingSchedule ScheduleOf(const TrainOptions& options, bool has_alpha) {
  // What a thread of a processor with AVX-512 does; it only decides between a few capacities.
  constexpr double kSamplesPerThreadSecond = 1.5e6;
  TrainingSchedule schedule =
      options.schedule
          ? *options.schedule
          : ScheduleFor(options.steps > 0 ? 1.0 * options.steps * options.samples_per_step
                                          : options.time_s * options.threads * kSamplesPerThreadSecond);
  if (!has_alpha) schedule.samples_per_pixel_from = 1;
  if (options.learning_rate > 0) schedule.learning_rate = options.learning_rate;
  if (options.field.log2_hashmap_size > 0) schedule.log2_hashmap_size = options.field.log2_hashmap_size;
  return schedule;
}

}  // namespace nerf
