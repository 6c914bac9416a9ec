// Oriented, coloured points as binary PLY: float x y z nx ny nz, uchar red green blue, ushort support, the
// number of training views that saw the point.
#pragma once

#include <filesystem>
#include <vector>

#include "pipeline/export/surfel_grid.h"
#include "pipeline/export/target_frame.h"

namespace pipeline {

// surfels: in scene coordinates. Throws kNoResources.
void ExportPoints(const std::vector<Surfel>& surfels,
                  const TargetFrame& target,
                  const std::filesystem::path& file);

}  // namespace pipeline
