// Whether a view from elsewhere shows what stands there: sparse points say where surfaces are, whatever was
// trained.
#pragma once

#include <optional>
#include <vector>

#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace nerf {

// Of the points in the picture that a training view saw from within kLikeDirection, the share before which
// the field shows a surface, by more than kNearerShare of their distance: walls and fog before the camera,
// and, for a few points, what hides them in truth. Nothing when fewer than kFewestPoints lie in the picture.
// Points whose observers are unknown all count. The picture is rendered with at most 128 pixels a side.
std::optional<double> HiddenPointShare(const TrainedField& field,
                                       const io::Camera& camera,
                                       const io::Rigid3d& world_from_cam,
                                       const io::Scene& train,
                                       int threads);

inline constexpr double kLikeDirection = 0.5;  // radians
inline constexpr double kNearerShare = 0.2;    // beyond what depth errs by at the edges of surfaces
inline constexpr int kFewestPoints = 20;

}  // namespace nerf
