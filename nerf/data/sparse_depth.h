// Depths that sparse points give to single pixels of the training pictures.
#pragma once

#include <vector>

#include "io/scene/scene.h"
#include "nerf/data/dataset.h"

namespace nerf {

// Points with fewer observers are not trusted: two rays always meet.
inline constexpr std::size_t kMinObservers = 3;

// One per observation of a trusted point by a frame of `scene`, where it falls on a used pixel.
std::vector<SparseDepth> SparseDepths(const io::Scene& scene, const Dataset& dataset);

}  // namespace nerf
