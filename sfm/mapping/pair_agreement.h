// Whether the verified pairs agree with the model. Where a scene repeats itself (identical facades, a
// symmetric object, a tiled floor) or moves, incremental mapping can fold different places into one: every
// point fits, yet pairs of pictures that match well contradict the poses.
#pragma once

#include <string>
#include <vector>

#include "io/scene/scene.h"
#include "sfm/colmap/colmap_database.h"
#include "sfm/features/features.h"

namespace sfm {

struct PairAgreement {
  int pairs = 0;          // verified pairs between pictures of the model
  int contradicting = 0;  // fewer than half of whose inliers agree with the model's poses
  // Inliers of the contradicting pairs over those of all pairs. Weighted, because repeated texture makes weak
  // wrong pairs in good captures, too: 17 % of the pairs but 7 % of the inliers in one of 50 photos.
  double contradicting_share = 0;
  // The same among pairs of following pictures: at most 3 apart in the order of the names. People walk, so
  // these overlap in truth.
  double following_contradicting_share = 0;

  // Whether so many pairs disagree that the model must not be trusted.
  bool Contradicts() const;
  std::string Figures() const;  // the shares, in one line
};

// names[i] is the picture of features[i]; frames of the scene carry the picture's name. With unit rays a and
// b of a match, in the world, and the vector t between the centres, a match agrees when the sine of the
// angle by which the rays miss each other,
//   |t . (a x b)| / sqrt(|t x a|^2 + |t x b|^2)
// (the Sampson error of the epipolar constraint on the sphere; Hartley and Zisserman, "Multiple View
// Geometry", section 11.4.3), is at most 8 px over the focal length, and the rays meet in front of both
// cameras or are parallel within that angle.
PairAgreement CompareWithPairs(const io::Scene& scene,
                               const std::vector<std::string>& names,
                               const std::vector<Features>& features,
                               const std::vector<VerifiedPair>& pairs);

}  // namespace sfm
