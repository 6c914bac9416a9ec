// Which pictures of a capture are held out of training.
#pragma once

#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace pipeline {

// One per frame; `frames` are in natural order of their names. About one in `every` is held out:
//   "every"   each every-th, from the first on: views between training views. Frames at one place, views of
//             a panorama, are held out together, so that the places are new as well
//   "sector"  the picture in the middle and those taken nearest to it: one side of the capture, which
//             training never saw from near by. Positions are compared in units of the capture's radius,
//             directions of view in radians, and the two are added.
std::vector<bool> HeldOutFrames(const std::vector<io::Frame>& frames, const std::string& holdout, int every);

// Takes every n-th frame out of `scene`, and their observations of its points; the result has no points.
io::Scene SetAside(int every, io::Scene* scene);

}  // namespace pipeline
