// How much of a ray is rendered.
#pragma once

#include <limits>
#include <optional>

#include "nerf/sampling/crop_box.h"

namespace nerf {

// Up to the distance `end`, and inside the box. Without either a ray goes on to infinity, where the field has
// rays end there.
struct RayLimits {
  float end = std::numeric_limits<float>::infinity();
  std::optional<CropBox> crop;

  bool AreOpen() const { return end == std::numeric_limits<float>::infinity() && !crop; }
};

}  // namespace nerf
