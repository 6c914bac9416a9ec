// How exactly features of different size can be placed.
#pragma once

#include <string>
#include <vector>

#include "io/scene/colmap_model.h"
#include "sfm/features/features.h"

namespace sfm {

// Sets Observation::sigma = (scale / s)^0.7 from the scale of the keypoint at the observation's position,
// with s the median over all observations: a feature of ten times the size is placed five times less exactly
// (Zeisl et al., "Estimation of Location Uncertainty for Scale Invariant Feature Points", BMVC 2009; the
// exponent is measured, see sfm/README.md). Observations without such a keypoint keep 1. names[i] is the
// picture of features[i]; every frame of the model is among them.
void SetSigmas(const std::vector<std::string>& names,
               const std::vector<Features>& features,
               io::ColmapModel* model);

}  // namespace sfm
