// What the kernels of splatting work on: Gaussians of a picture, blended front to back in tiles of 16 x 16
// pixels (Kerbl et al. 2023). At a pixel centre with the offset (dx, dy) from the middle of a splat
//   alpha = min(0.99, opacity exp(-(a dx^2 + c dy^2) / 2 - b dx dy)),  0 where that is below 1 / 100,
//   rgb += transmittance alpha colour,  transmittance *= 1 - alpha,
// until the transmittance is below 0.004, a grey level. The reference implementation has 1 / 255 and 1e-4,
// which take a tenth to a sixth longer and are no better (EXPERIMENTS.md). Against exact arithmetic, colours
// in [0, 1] and transmittances err by less than 1e-5, gradients by 0.2 % and 2e-3 of what a pixel's gradient
// of 1 makes (tests/nerf/kernels/splat_blending_test.cpp), but where a threshold is crossed.
#pragma once

namespace nerf::kernels {

inline constexpr int kTileSide = 16, kTilePixels = kTileSide * kTileSide;
inline constexpr float kMaxSplatAlpha = 0.99f, kMinSplatAlpha = 1.f / 100.f, kOpaqueSplats = 4e-3f;

template <typename Scalar>
struct BlendedSplatOf {
  Scalar x, y;                  // middle [px], pixel centres at 0.5
  Scalar a, b, c;               // inverse covariance [1 / px^2]
  Scalar opacity;               // in [kMinSplatAlpha, 1]
  Scalar rgb[3];                // >= 0
  Scalar reach_x, reach_y;      // the splat does not count farther away than this [px] ...
  Scalar max_distance_squared;  // ... nor where a dx^2 + 2 b dx dy + c dy^2 is above this: 2 ln(100 opacity)
};
using BlendedSplat = BlendedSplatOf<float>;

// d loss / d what a splat is blended from, summed over the pixels of a tile.
struct BlendedSplatGradient {
  float x, y, a, b, c, opacity, rgb[3];
};

// Blends n splats, nearest first, over the tile whose first pixel is (x, y). rgb: [3][16][16] and
// transmittance: [16][16], in and out.
using BlendSplatsFunction =
    void (*)(const BlendedSplat* splats, int n, int x, int y, float* rgb, float* transmittance);

// gradients[n] for rgb_gradient [3][16][16], the gradient of the loss by the picture. to_come: [16][16], the
// product of that gradient with the finished colour of each pixel, background included.
using BlendSplatsGradientFunction = void (*)(const BlendedSplat* splats,
                                             int n,
                                             int x,
                                             int y,
                                             const float* rgb_gradient,
                                             const float* to_come,
                                             BlendedSplatGradient* gradients);

}  // namespace nerf::kernels
