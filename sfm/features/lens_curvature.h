// Lenses that bend straight lines strongly, fisheyes and action cameras, told from matches alone.
//
// Division model (Fitzgibbon, "Simultaneous linear estimation of multiple view geometry and lens distortion",
// CVPR 2001), about the middle of the picture: what such a lens shows at radius r, a pinhole camera with the
// same scale in the middle shows at r / (1 + curvature r^2). Radii are in half diagonals of the picture.
// Curvature is 0 for a pinhole camera, -0.1 for a wide-angle lens, -0.6 for an action camera of 118 degrees.
#pragma once

#include <vector>

#include "sfm/features/features.h"
#include "sfm/features/matching.h"

namespace sfm {

// Infinite where a pinhole camera sees nothing: 90 degrees and more off the axis. curvature <= 0, r >= 0.
double PinholeRadius(double curvature, double r);

// The inverse: r / (1 + curvature r^2) = r_pinhole, the root between 0 and the radius of 90 degrees.
double LensRadius(double curvature, double r_pinhole);

// In half diagonals, if the angle off the axis grows about in proportion to the radius, as fisheyes have it:
// with r = focal * angle the division model fits best at curvature = -0.36 / focal^2. curvature < 0.
double FisheyeFocal(double curvature);

struct LensCurvature {
  double curvature = 0;                       // 0: the lens is not strongly curved, or that cannot be told
  double agreeing = 0, agreeing_pinhole = 0;  // share of the matches with epipolar geometry, with and without
};

// Straight lines of a scene make matches agree with epipolar geometry only where they are straight in the
// pictures as well: of a series of curvatures the one that most matches agree with. `features[i]` are of
// picture i, and all pictures are width x height. Where a pinhole camera explains nearly as many matches,
// curvature is 0: weak distortion is adjusted with the cameras.
LensCurvature FindLensCurvature(const std::vector<Features>& features,
                                const std::vector<PairMatches>& pairs,
                                int width,
                                int height,
                                int threads);

}  // namespace sfm
