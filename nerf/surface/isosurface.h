// The zero set of a sampled function as triangles: dual contouring with the mean of the crossings, known as
// naive surface nets [Gibson, "Constrained elastic surface nets", MICCAI 1998].
//
// A cell between 8 samples of both signs gets one vertex, the mean of the points at which the function,
// linear along the cell's edges, is zero; an edge whose ends differ in sign becomes the quadrilateral of the
// four cells around it. Planes come out exact, and triangles hardly ever as slivers, unlike with marching
// cubes, whose table of 256 cases this does without. (OpenVDB and VTK would bring tens of libraries for these
// hundred lines; CGAL's mesher is under the GPL.)
#pragma once

#include "io/process/parallel.h"
#include "io/scene/mesh.h"
#include "nerf/surface/sparse_volume.h"

namespace nerf {

// The function is positive outside of the surface. Cells with an unknown sample have no surface, so that it
// ends where nothing is known. Colours are black; normals are means of the triangles around, by area. The
// result does not depend on the number of workers.
io::Mesh ExtractIsosurface(const SparseVolume& volume, io::Workers* workers);

}  // namespace nerf
