// The plain reference of blending; its gradient is checked by differences of it.
#pragma once

#include <algorithm>
#include <cmath>

#include "nerf/kernels/splat_blending.h"

namespace nerf::kernels::reference {

// Blends one splat over the pixel at (column, row) of a tile or picture, whose centre is half a pixel
// further.
template <typename Scalar>
void BlendSplat(
    const BlendedSplatOf<Scalar>& splat, int column, int row, Scalar rgb[3], Scalar* transmittance) {
  if (*transmittance < Scalar(kOpaqueSplats)) return;
  const Scalar dx = column + Scalar(0.5) - splat.x, dy = row + Scalar(0.5) - splat.y;
  const Scalar power = -(splat.a * dx * dx + splat.c * dy * dy) / 2 - splat.b * dx * dy;
  const Scalar alpha = std::min(Scalar(kMaxSplatAlpha), splat.opacity * std::exp(power));
  if (alpha < Scalar(kMinSplatAlpha)) return;
  for (int c = 0; c < 3; ++c) rgb[c] += *transmittance * alpha * splat.rgb[c];
  *transmittance *= 1 - alpha;
}

}  // namespace nerf::kernels::reference
