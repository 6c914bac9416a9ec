// Transients: what one picture shows and the others do not, such as passers-by, cars, a hand. A field
// explains them by floaters before the picture's camera, which other views meet.
//
// Soon after training has begun, a field shows what stands behind them, for most pictures agree on that. In a
// small rendering of each training view, e is the difference from the photograph: of each channel the mean
// over 3 x 3 pixels, without the picture's own tint; of these the root mean square. A pixel is suspect where
// e is large and a multiple of its median in views that see the same surface. Suspects that touch are a
// transient when they are many, differ strongly somewhere, and have a texture of their own:
//
//   sum(dP . dR) / sqrt(sum |dP|^2 sum |dR|^2) < 0.3,   dP, dR: slopes of photograph and rendering.
//
// Shadows and highlights, which move with the camera or the photographer, keep the texture that they lie on.
// Where a pose or a depth is wrong, as of what few views show far behind the subject, the field shows the
// same a few pixels beside: that is no transient either. Before the sky nothing is suspect: other views see
// it beside a roof that the field has not learnt yet.
#pragma once

#include <cstdint>
#include <vector>

#include "io/process/parallel.h"
#include "io/scene/scene.h"
#include "nerf/data/dataset.h"
#include "nerf/fields/scene_field.h"

namespace nerf {

// The camera of a view's small picture.
io::Camera TransientCamera(const io::Scene& scene, std::size_t view);

// Of the small pictures of all views, one after the other by rows, 1 where a transient is; empty where there
// is none at all. Of RGB pictures. world_from_cam: of the frames of `scene`, as training has moved them.
// used: of the pixels, empty for all; what is not used is neither suspect nor asked. margin: pixels of the
// small pictures by which a transient is made larger, 2 or more: e blurs its edge. Throws io::Interrupted.
std::vector<std::uint8_t> FindTransients(const io::Scene& scene,
                                         const std::vector<io::Rigid3d>& world_from_cam,
                                         const Dataset& dataset,
                                         const std::vector<bool>& used,
                                         int margin,
                                         const SceneField& scene_field,
                                         io::Workers* workers);

}  // namespace nerf
