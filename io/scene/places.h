// Frames taken from one place: views of a panorama.
#pragma once

#include <cstddef>
#include <vector>

#include "io/scene/scene.h"

namespace io {

// Of each frame the index of the first one that stands where it does, up to rounding in files of decimals:
// its own unless it stands where another one did. Poses that were estimated one by one are never equal.
std::vector<std::size_t> FirstAtPlace(const std::vector<Frame>& frames);

}  // namespace io
