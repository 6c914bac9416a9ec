// The plain reference of projection; its gradient is checked by differences of it.
#pragma once

#include <algorithm>
#include <cmath>

#include "nerf/kernels/splat_projection.h"

namespace nerf::kernels::reference {

struct ProjectedSplat {
  double depth;  // p_z; <= nearest: it is not seen
  BlendedSplatOf<double> blended;
};

// The splat whose values begin at these places, whether or not it lies in the picture.
inline ProjectedSplat ProjectSplat(const SplatCamera& camera, const SplatArrays<const double>& splat) {
  const auto at = [&](int row, int column) { return static_cast<double>(camera.rotation[3 * row + column]); };
  double offset[3], p[3], length = 0, turn_length = 0;
  for (int i = 0; i < 3; ++i) offset[i] = splat.places[i] - static_cast<double>(camera.centre[i]);
  for (int i = 0; i < 3; ++i) {
    p[i] = at(i, 0) * offset[0] + at(i, 1) * offset[1] + at(i, 2) * offset[2];
    length += offset[i] * offset[i];
  }
  const double fl[2] = {camera.fl_x, camera.fl_y};
  for (int i = 0; i < 4; ++i) turn_length += splat.rotations[i] * splat.rotations[i];
  double q[4];
  for (int i = 0; i < 4; ++i) q[i] = splat.rotations[i] / std::sqrt(turn_length);
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double turn[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                             {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                             {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  double axes[2][3] = {}, covariance[3] = {camera.low_pass, 0, camera.low_pass};
  for (int i = 0; i < 2; ++i) {
    const double slope = std::clamp(p[i] / p[2],
                                    static_cast<double>(camera.lowest_slope[i]),
                                    static_cast<double>(camera.highest_slope[i]));
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) axes[i][k] += fl[i] / p[2] * (at(i, j) - slope * at(2, j)) * turn[j][k];
      axes[i][k] *= std::exp(splat.log_scales[k]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    covariance[0] += axes[0][k] * axes[0][k];
    covariance[1] += axes[0][k] * axes[1][k];
    covariance[2] += axes[1][k] * axes[1][k];
  }
  const double determinant = covariance[0] * covariance[2] - covariance[1] * covariance[1];
  ProjectedSplat projected{p[2], {}};
  BlendedSplatOf<double>& blended = projected.blended;
  blended.x = fl[0] * p[0] / p[2] + static_cast<double>(camera.cx);
  blended.y = fl[1] * p[1] / p[2] + static_cast<double>(camera.cy);
  blended.a = covariance[2] / determinant;
  blended.b = -covariance[1] / determinant;
  blended.c = covariance[0] / determinant;
  blended.opacity = 1 / (1 + std::exp(-splat.opacities[0]));
  length = std::sqrt(length);
  const double harmonics[kSplatHarmonics] = {kSplatHarmonic0,
                                             -kSplatHarmonic1 * offset[1] / length,
                                             kSplatHarmonic1 * offset[2] / length,
                                             -kSplatHarmonic1 * offset[0] / length};
  for (int c = 0; c < 3; ++c) {
    double value = 0.5;
    for (int k = 0; k < kSplatHarmonics; ++k) value += harmonics[k] * splat.colours[3 * k + c];
    blended.rgb[c] = std::max(value, 0.0);  // a NaN stays one
  }
  blended.max_distance_squared = std::max(0.0, 2 * std::log(blended.opacity / double{kMinSplatAlpha}));
  blended.reach_x = std::sqrt(blended.max_distance_squared * covariance[0]);
  blended.reach_y = std::sqrt(blended.max_distance_squared * covariance[2]);
  return projected;
}

}  // namespace nerf::kernels::reference
