// Depth views fused into one signed distance per sample of a sparse lattice [Curless and Levoy, "A volumetric
// method for building complex models from range images", SIGGRAPH 1996].
//
// A sample x that projects into a pixel whose facet has point p, normal n and weight w (depth_view.h) is
//   d = n . (x - p)
// before that facet, in the view's axes: exact on planes at any slant, and across half a pixel. The fused
// distance is sum w min(d, truncation) / sum w over the views with d >= -truncation: what lies further behind
// a surface is hidden by it. A pixel whose ray meets nothing says d = truncation.
#pragma once

#include <span>

#include "nerf/surface/depth_view.h"
#include "nerf/surface/sparse_volume.h"

namespace nerf {

struct FusionOptions {
  io::Aabb box;              // facets outside are left out
  double voxel = 0.01;       // side of a cell, scene units
  double truncation = 0.04;  // a few voxels: beyond what the views' depths differ by
};

// Positive in front of surfaces, unknown where no view says anything. Blocks lie where facets are. The result
// does not depend on the number of workers.
SparseVolume FuseDepthViews(std::span<const DepthView> views,
                            const FusionOptions& options,
                            io::Workers* workers,
                            const std::function<void(double share)>& progress);

}  // namespace nerf
