// A scene of 3D Gaussians, as the reference implementation of 3D Gaussian Splatting has it (Kerbl et al.
// 2023): density proportional to exp(-(x - place)^T C^-1 (x - place) / 2), C = R diag(exp(2 log_scale)) R^T
// with R of the quaternion, opacity 1 / (1 + exp(-logit)), and a colour that depends on the direction d from
// the camera,
//   rgb = max(0, 0.5 + h0 k0 + h1 (-d_y k1 + d_z k2 - d_x k3)),  h0 = 1 / sqrt(4 pi), h1 = sqrt(3 / (4 pi)).
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "io/scene/scene.h"
#include "nerf/kernels/splat_projection.h"

namespace nerf {

inline constexpr int kHarmonics = kernels::kSplatHarmonics;
inline constexpr double kHarmonic0 = kernels::kSplatHarmonic0, kHarmonic1 = kernels::kSplatHarmonic1;

// What the reference implementation adds to variances in the picture, so that no splat is thinner than a
// pixel [px^2]; and how far beyond the edges of the picture its projection is linearised, in widths of the
// picture, so that in a band of a picture, cut out of its height, splats look as in the whole.
inline constexpr double kLowPass = 0.3, kSlopeMargin = 0.15;
// Splats nearer to the camera's plane are not drawn, in scene units.
inline constexpr double kNearestSplat = 0.2;

struct Splats {
  std::vector<float> places;      // [n][3], scene units
  std::vector<float> log_scales;  // [n][3], natural logarithms of standard deviations
  std::vector<float> rotations;   // [n][4], quaternions w x y z of any length but 0
  std::vector<float> opacities;   // [n], logits
  std::vector<float> colours;     // [n][kHarmonics][3]

  std::size_t size() const { return opacities.size(); }
  void resize(std::size_t n) {
    places.resize(3 * n), log_scales.resize(3 * n), rotations.resize(4 * n), opacities.resize(n);
    colours.resize(3 * kHarmonics * n);
  }
};

struct SplatView {
  io::Camera camera;  // free of distortion
  io::Rigid3d world_from_cam;
  double low_pass = kLowPass;  // added to variances in the picture [px^2]
};

// Those whose middles are wanted, in their order.
Splats SplatsWhere(const Splats& splats, const std::function<bool(const Eigen::Vector3d& middle)>& wanted);

// The view as the kernels need it.
kernels::SplatCamera CameraOf(const SplatView& view);

}  // namespace nerf
