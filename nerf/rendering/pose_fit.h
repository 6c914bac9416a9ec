// The pose at which a trained field, left as it is, shows a photograph best, near a given pose: how a
// held-out view would score if its own pose were right.
//
// With I(p; x) the rendered colour of pixel p after the motion x (sampling/pose_motion.h),
//   E(x) = sum over pixels and channels of rho(I(p; x) - photo(p)),   rho: Huber's.
// A motion moves what p shows by J x, J = d pixel / d x at the rendered depth, so d I / d x is about
// -grad(photo) J: Gauss-Newton steps need one render each (Lucas and Kanade 1981). Small pictures come first,
// for their wide basin; the last ones are half as large as the photograph, because its own size tells hardly
// more.
#pragma once

#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"

namespace nerf {

struct FittedPose {
  io::Rigid3d world_from_cam;
  double moved_px = 0;  // RMS displacement of the photograph's pixels by the motion
};

// photo: RGB, of the camera's size; pixels that the mask does not use are left out. Where nothing near shows
// the photograph better, the pose stays as it is. Throws kBadInput for another size.
FittedPose FitPose(const TrainedField& field,
                   const io::Camera& camera,
                   const io::Rigid3d& world_from_cam,
                   const io::Image& photo,
                   const io::Mask& mask,
                   int threads);

}  // namespace nerf
