// Structural similarity (Wang et al. 2004) in blocks of 4 x 4 pixels, as a part of the splats' loss:
//   SSIM = (2 mu_x mu_y + C1) (2 sigma_xy + C2) / ((mu_x^2 + mu_y^2 + C1) (sigma_x^2 + sigma_y^2 + C2))
// of each channel of each block, whose pixels count alike. Gaussian windows gain as much for a pass of their
// own over the picture; blocks are done where a tile is, for 2 % of a step (EXPERIMENTS.md).
#pragma once

#include "nerf/kernels/splat_blending.h"

namespace nerf {

// One channel of a tile, [16][16] each: adds weight times the gradient of the sum over pixels of 1 - the SSIM
// of their block by `shown`. Blocks with a pixel that does not count add nothing.
void AddBlockSsimGradient(
    const float* shown, const float* wanted, const bool* counts, float weight, float* gradient);

}  // namespace nerf
