// The sky in photographs: pixels whose light comes from infinitely far away.
#pragma once

#include <vector>

#include "io/process/parallel.h"
#include "nerf/data/dataset.h"

namespace nerf {

// Whether each pixel shows the sky; empty: none does. A sky
// - is blue, or so bright that it is nearly white; grey clouds count where it surrounds them,
// - reaches the upper edge of the picture without a step in its colours, but hardly below the horizon,
// - has no texture,
// - and has nothing before it: no sparse point, of whatever view, projects to it.
// Pictures have to have three channels.
std::vector<bool> FindSky(const io::Scene& scene, const Dataset& dataset, io::Workers* workers);

}  // namespace nerf
