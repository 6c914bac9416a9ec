#include "nerf/splatting/block_ssim.h"

namespace nerf {
namespace {

using kernels::kTileSide;

constexpr int kSide = 4;
// Of the usual definition, for values in [0, 1].
constexpr float kC1 = 0.01f * 0.01f, kC2 = 0.03f * 0.03f;

// d SSIM / d shown of a pixel is (by_value + by_shown shown + by_wanted wanted) / pixels.
struct BlockGradient {
  float by_value, by_shown, by_wanted;
};

BlockGradient GradientOf(const float* shown, const float* wanted) {
  constexpr float kShare = 1.f / (kSide * kSide);
  float x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (int v = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u) {
      const float a = shown[v * kTileSide + u], b = wanted[v * kTileSide + u];
      x += a, y += b, xx += a * a, yy += b * b, xy += a * b;
    }
  }
  x *= kShare, y *= kShare;
  const float means = 2 * x * y + kC1, mean_squares = x * x + y * y + kC1;
  const float covariance = 2 * (kShare * xy - x * y) + kC2,
              variances = kShare * (xx + yy) - x * x - y * y + kC2;
  const float scale = 2 / (mean_squares * variances), ssim = 0.5f * scale * means * covariance;
  return {scale * y * (covariance - means) + 2 * ssim * x * (1 / variances - 1 / mean_squares),
          -2 * ssim / variances,
          scale * means};
}

}  // namespace

void AddBlockSsimGradient(
    const float* shown, const float* wanted, const bool* counts, float weight, float* gradient) {
  for (int y = 0; y < kTileSide; y += kSide) {
    for (int x = 0; x < kTileSide; x += kSide) {
      const int first = y * kTileSide + x;
      bool all_count = true;
      for (int v = 0; v < kSide; ++v)
        for (int u = 0; u < kSide; ++u) all_count = all_count && counts[first + v * kTileSide + u];
      if (!all_count) continue;
      const BlockGradient by = GradientOf(shown + first, wanted + first);
      for (int v = 0; v < kSide; ++v) {
        for (int u = 0; u < kSide; ++u) {
          const int i = first + v * kTileSide + u;
          gradient[i] -= weight * (by.by_value + by.by_shown * shown[i] + by.by_wanted * wanted[i]);
        }
      }
    }
  }
}

}  // namespace nerf
