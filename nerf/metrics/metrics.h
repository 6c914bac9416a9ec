// PSNR and SSIM of 8-bit sRGB pictures, accumulated in double. Both pictures are RGB of one size, and so is
// the mask unless it is empty; anything else throws kBadInput.
#pragma once

#include "io/image/image.h"
#include "io/image/mask.h"

namespace nerf {

// The PSNR reported for an error below 1e-12, identical pictures included: JSON has no infinity. One grey
// level in one channel of one pixel is above it up to 5 megapixels.
inline constexpr double kMaxPsnrDb = 120.0;

// Mean over used pixels and channels of (a - b)^2, with values v / 255 in [0, 1].
double MeanSquaredError(const io::Image& a, const io::Image& b, const io::Mask& mask = {});

// The same between `truth` and `render` whose channels were scaled by the gains that make it smallest, those
// of least squares: what is left when exposure and white balance do not count.
double ColourAlignedError(const io::Image& truth, const io::Image& render, const io::Mask& mask = {});

// -10 log10(mse), at most kMaxPsnrDb.
double PsnrFromMse(double mse);

// Mean structural similarity of Wang, Bovik, Sheikh and Simoncelli, "Image quality assessment: from error
// visibility to structural similarity", IEEE TIP 2004: 11x11 Gaussian window of sigma 1.5, valid region only,
// population covariance, k1 = 0.01, k2 = 0.03, data range 1, mean of the three channels. With a mask, the
// mean is over the windows whose centre is used; they reach 5 pixels beyond it. Throws kBadInput below 11
// pixels and when no window is left.
double Ssim(const io::Image& a, const io::Image& b, const io::Mask& mask = {});

}  // namespace nerf
