// A part of a model that is small enough to adjust several times, and observations it is tested on.
#pragma once

#include <cstdint>
#include <vector>

#include "io/scene/colmap_model.h"

namespace sfm {

struct ObservationSplit {
  io::ColmapModel training;               // all frames and cameras, some of the points
  std::vector<io::Observation> held_out;  // of points of `training`
};

// Keeps about 1500 points, the longest tracks first, but spread over all parts of all pictures: distortion
// shows in the corners. Of points with more than 24 observations, 24 are kept. Every tenth observation, by a
// hash with `seed`, is held out as long as 3 of its point remain.
ObservationSplit SplitObservations(const io::ColmapModel& model, std::uint64_t seed);

// Root of the mean robust loss (sfm/bundle/reprojection_cost.h) over the observations whose point lies in
// front of the camera: like the RMS of the reprojection errors, but a few mismatches do not decide it. 0
// without any.
double HeldOutPx(const io::Scene& scene, const std::vector<io::Observation>& held_out);

}  // namespace sfm
