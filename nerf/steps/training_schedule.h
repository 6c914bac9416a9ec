// How the training of the `hash` field unfolds over its budget. Capacity, learning rate and sampling are
// chosen for the number of samples that the budget affords: what is best after a minute is not what is best
// after five seconds, cut off later.
#pragma once

#include <string>

namespace nerf {

struct TrainingSchedule {
  int log2_hashmap_size = 17;
  double finest_cell_pixels = 0.9;  // side of the finest grid cells, in pixel footprints
  bool entry_moments = false;  // of the tables' optimiser, see hash_grid.h: short runs learn faster with them
  double learning_rate = 1e-2;  // held for a share of the run ...
  double hold = 0.6;
  double last_rate = 0.02;  // ... before it falls exponentially to this share
  // Sampling intervals start so much longer than the field's own, for more rays with the same samples, and
  // shrink to it exponentially within a share of the run.
  double first_step_scale = 6, step_scale_share = 0.5;
  // From this share of the run on, a pixel is the mean of several rays, as in the camera: edges may then be
  // sharper than a pixel. 1: never.
  int samples_per_pixel = 4;
  double samples_per_pixel_from = 0.7;

  // At progress in [0, 1].
  double LearningRate(double progress) const;
  double StepScale(double progress) const;
  int SamplesPerPixel(double progress) const {
    return samples_per_pixel_from < 1 && progress >= samples_per_pixel_from ? samples_per_pixel : 1;
  }
  // One line for the record of a run.
  std::string Text() const;
};

// The best schedule known for about n_samples samples. Measured on the validation views of Lego; see
// nerf/EXPERIMENTS.md.
TrainingSchedule ScheduleFor(double n_samples);

}  // namespace nerf
