// Projection of a Gaussian to a picture after Zwicker, Pfister, van Baar and Gross, "EWA splatting", 2002:
// its covariance goes through the projection's Jacobian at its middle; and the gradient of that by hand.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "nerf/kernels/splat_blending.h"
#include "nerf/splatting/splats.h"

namespace nerf {

// A view as the projection needs it: OpenCV axes, z forward.
struct SplatCamera {
  explicit SplatCamera(const SplatView& view)
      : rotation(io::FlipCameraAxes(view.world_from_cam).Inverse().rotation.cast<float>()),
        centre(view.world_from_cam.translation.cast<float>()),
        fl_x(static_cast<float>(view.camera.fl_x)),
        fl_y(static_cast<float>(view.camera.fl_y)),
        cx(static_cast<float>(view.camera.cx)),
        cy(static_cast<float>(view.camera.cy)),
        max_slope_x(static_cast<float>(kMaxSlopeShare * 0.5 * view.camera.width / view.camera.fl_x)),
        max_slope_y(static_cast<float>(kMaxSlopeShare * 0.5 * view.camera.height / view.camera.fl_y)) {}

  Eigen::Matrix3f rotation;  // cam_from_world
  Eigen::Vector3f centre;
  float fl_x, fl_y, cx, cy, max_slope_x, max_slope_y;
};

// One splat in one view.
class SplatProjection {
 public:
  // False when the splat is not seen: too near or behind, or too faint. Then nothing else may be called.
  bool Project(const SplatCamera& camera, const Splats& splats, std::size_t index);

  const kernels::BlendedSplat& blended() const { return blended_; }
  float depth() const { return in_cam_.z(); }  // along the optical axis
  // Fills row `index` of `gradient` from d loss / d blended().
  void PullBack(const kernels::BlendedSplatGradient& blended, std::size_t index, Splats* gradient) const;

 private:
  using Matrix23f = Eigen::Matrix<float, 2, 3>;
  Matrix23f Jacobian() const;

  const SplatCamera* camera_ = nullptr;
  const Splats* splats_ = nullptr;
  kernels::BlendedSplat blended_ = {};
  Eigen::Vector3f in_cam_, in_scene_;                 // from the camera's centre, in its axes and the scene's
  Eigen::Vector3f scales_;                            // standard deviations
  Eigen::Matrix3f axes_;                              // columns
  Matrix23f picture_from_scene_, picture_from_axes_;  // to first order; the latter times the scales
};

}  // namespace nerf
