// A mesh moved to the sparse points near it.
//
// A field shows its surfaces a fraction of a pixel's footprint nearer to the cameras than they are, more on
// some materials than on others. Triangulated points have no such bias, but each has an error of its own: the
// mean over many of them tells by how much the surface around them is off.
#pragma once

#include "io/process/parallel.h"
#include "io/scene/mesh.h"
#include "io/scene/scene.h"

namespace nerf {

struct PointFit {
  std::size_t points = 0;    // near the mesh
  double median_offset = 0;  // of these along the mesh's normals before the fit, in the unit of the mesh
};

// Moves each vertex along its normal by  sum_p w_p d_p / (sum_p w_p + kPriorWeight)  over the points p that
// are nearest to it and whose surface faces like it: d_p is the offset of the point along the normal of the
// vertex nearest to it, w_p = (1 - r^2)^2 with r = distance / (kFitFootprints * footprint). Points further
// than kNearFootprints from all vertices show another surface, and have no say. footprint: of a pixel, in the
// unit of the mesh, which is that of the points. The result does not depend on the number of workers.
PointFit FitToPoints(const std::vector<io::Point3D>& points,
                     double footprint,
                     io::Workers* workers,
                     io::Mesh* mesh);

// Measured on the sample: nerf/EXPERIMENTS.md.
inline constexpr double kNearFootprints = 2, kFitFootprints = 30;
// A point alone moves the surface by a fifth of its offset.
inline constexpr double kPriorWeight = 4;

}  // namespace nerf
