// Points of the surfaces that a trained field shows to its training views.
#pragma once

#include <cstdint>
#include <vector>

#include "nerf/data/dataset.h"
#include "nerf/fields/scene_field.h"
#include "nerf/splatting/surface_splats.h"

namespace nerf {

// `number` used pixels of all views, chosen by chance, half of them evenly and half in proportion to how much
// the photograph changes there; each at the distance where half of its ray's light is absorbed, with the
// colour of the photograph. Normals are those of the plane through the pixel and two
// beside it, and where these show something else they point to the camera. Where rays leave the scene the
// point lies too far away to move between views; where the field has nothing there, or the photograph shows
// the sky (Dataset::sky), there is none.
std::vector<SurfacePoint> FieldSurface(const SceneField& scene_field,
                                       const Dataset& dataset,
                                       std::size_t number,
                                       std::uint64_t seed,
                                       io::Workers* workers);

}  // namespace nerf
