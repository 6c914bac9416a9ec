// Which pairs of a capture are worth matching.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sfm/features/image_pairs.h"
#include "sfm/reconstruction.h"

namespace sfm {

// By options.matching; "auto" takes all pairs of up to 30 pictures, and beyond that following frames and
// loops of a video, and of photos those most alike. decide: receives one line.
ImagePairs ChoosePairs(const std::vector<Picture>& pictures,
                       const std::vector<Features>& features,
                       const ReconstructionOptions& options,
                       const std::function<void(const std::string&)>& decide);

}  // namespace sfm
