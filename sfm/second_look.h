// The second look at pictures that a model left out: what they are compared with, what that may cost, and
// whether the poses that were found on little evidence can be trusted.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "sfm/bundle/bundle_uncertainty.h"
#include "sfm/features/image_pairs.h"
#include "sfm/mapping/mapping_attempt.h"

namespace sfm {

// Indices of the pictures that the largest model lacks; those with the most verified matches come first.
std::vector<int> LeftOutPictures(const MappingAttempt& attempt);

// Each of these with all others of `n`.
ImagePairs PairsWith(const std::vector<int>& pictures, int n);

// Descriptors compared to match the pairs.
double Comparisons(const std::vector<Features>& features, const ImagePairs& pairs);

// As many of `pictures`, in their order, as can be matched with all others within `ceiling` comparisons when
// each of them has up to `max_features`.
std::vector<int> WithinCeiling(const std::vector<int>& pictures,
                               const std::vector<Features>& features,
                               int max_features,
                               double ceiling);

// Takes those of `names` out of the largest model whose own pairs contradict their pose for the most part;
// returns them. A picture that was added to a finished model on little evidence may have been put anywhere.
std::vector<std::string> DropContradicted(const std::vector<std::string>& names, MappingAttempt* attempt);

struct UncertainPicture {
  std::string name;
  int n_points;         // that it observes
  double rotation_deg;  // one standard deviation
  double median_deg;    // of all pictures
};

// Pictures of an adjusted model whose few observations hardly determine their pose, while those of the others
// do: such a picture was mostly put where another place looks alike. Largest uncertainty first.
std::vector<UncertainPicture> UncertainPictures(const io::ColmapModel& model,
                                                const BundleUncertainty& uncertainty);

struct MisfittingPicture {
  std::string name;
  int n_points;      // that it observes
  double error_px;   // mean reprojection error, divided by Observation::sigma
  double median_px;  // of all pictures
};

// Pictures of an adjusted model that observe hardly any points, and those with large errors. What shines
// shows reflections: they move with the camera and agree, though not well, on a pose that is wrong by
// degrees. Largest error first.
std::vector<MisfittingPicture> MisfittingPictures(const io::ColmapModel& model);

// The model without these frames, without points that fewer than two other frames see, and without cameras
// that took none of the others.
io::ColmapModel WithoutFrames(const io::ColmapModel& model, const std::set<std::string>& names);

}  // namespace sfm
