// Exposure and tint that are a picture's own: what a camera chose anew for each picture.
//
// With sparse point j in picture i, in each channel:  log colour_ij = log colour_j + g_i,  and  g = s + e.
// s changes smoothly with the camera's place and direction, as with a flash that the camera carries; a field
// learns it as it learns gloss, and shows it in views between the pictures. e differs from picture to picture
// at random: no view can be shown with it, and a field that meets it explains it by floaters.
//
// s is a Gaussian process over the cameras' poses, e white noise; their lengths and shares are those of the
// largest likelihood [Rasmussen and Williams 2006, sections 2.2 and 5.4.1].
#pragma once

#include <array>
#include <vector>

#include "nerf/data/dataset.h"

namespace nerf {

// exp(e) of each view and channel; empty where e spreads too little to matter, or where too few views see
// enough of the sparse points (dataset.depths).
using PictureGains = std::vector<std::array<double, 3>>;
PictureGains FindPictureGains(const Dataset& dataset);
// Standard deviation of e.
double SpreadOf(const PictureGains& gains);

// Divides the pixels of RGB pictures by their gains. White stays white: it is overexposed in any picture.
void EvenOut(const PictureGains& gains, Dataset* dataset);

}  // namespace nerf
