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
        slopes_x(Slopes(view.camera.width, view.camera.width, view.camera.cx, view.camera.fl_x)),
        slopes_y(Slopes(view.camera.height, view.camera.width, view.camera.cy, view.camera.fl_y)),
        width(static_cast<float>(view.camera.width)),
        height(static_cast<float>(view.camera.height)),
        low_pass(static_cast<float>(view.low_pass)) {}

  // Whether a splat at a place with this largest standard deviation, in scene units, lies beside the picture
  // for certain: most splats of a room do, and the rest of their projection need not be known.
  bool IsBeside(const Eigen::Vector3f& in_cam, float largest_scale) const;

  Eigen::Matrix3f rotation;  // cam_from_world
  Eigen::Vector3f centre;
  float fl_x, fl_y, cx, cy;
  // Of x / z and y / z, between which the projection is linearised where the splat is; beyond, at the limit.
  struct Range {
    float low, high;
    float Clamp(float slope) const { return std::clamp(slope, low, high); }
    bool Holds(float slope) const { return slope > low && slope < high; }
    float Largest() const { return std::max(-low, high); }
  } slopes_x, slopes_y;
  float width, height, low_pass;

 private:
  static Range Slopes(double size, double width, double middle, double fl) {
    const double margin = kSlopeMargin * width;
    return {static_cast<float>((-middle - margin) / fl), static_cast<float>((size - middle + margin) / fl)};
  }
};

// One splat in one view.
class SplatProjection {
 public:
  // False when the splat is not seen: too near, behind, beside, or too faint. Then nothing else may be
  // called.
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
