// The picture of splats as plainly as it can be written, in double: what the fast one is compared with, and
// what quality is stated with.
#pragma once

#include <array>
#include <vector>

#include "nerf/splatting/splats.h"

namespace nerf {

// [height][width][3], before a background of sRGB in [0, 1].
std::vector<double> RenderPlainly(const Splats& splats,
                                  const SplatView& view,
                                  const std::array<double, 3>& background);

}  // namespace nerf
