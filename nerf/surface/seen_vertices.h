// Which views see the vertices of a mesh, and the colours that they see there.
#pragma once

#include <span>

#include "io/scene/mesh.h"
#include "nerf/surface/depth_view.h"

namespace nerf {

// A view sees a vertex that lies in its picture, faces it by more than this cosine, and is as far away as
// what the view shows there, up to so many pixels' footprints along the surface's normal.
inline constexpr float kLeastFacing = 0.1f, kSeenFootprints = 3;

// Returns the number of views that see each vertex [n_vertices], and sets the colours of those that are seen:
// means over these views with the weights of their facets, which prefer views from near and from the front.
std::vector<int> ColourVertices(std::span<const DepthView> views, io::Workers* workers, io::Mesh* mesh);

}  // namespace nerf
