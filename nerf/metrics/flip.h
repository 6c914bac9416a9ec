// FLIP: the error a person sees when two pictures are shown in turn. Andersson, Nilsson, Akenine-Moller,
// Oskarsson, Astrom and Fairchild, "FLIP: A Difference Evaluator for Alternating Images", Proc. ACM Comput.
// Graph. Interact. Tech. (HPG) 2020.
#pragma once

#include <vector>

#include "io/image/image.h"
#include "io/image/mask.h"

namespace nerf {

struct FlipOptions {
  // Pixels per degree of visual angle: a 0.7 m wide display of 3840 pixels seen from 0.7 m, the paper's
  // default.
  double pixels_per_degree = 67.0206;
};

struct FlipMap {
  int width = 0, height = 0;
  std::vector<float> error;  // [height][width], in [0, 1]
  double mean = 0;           // over the used pixels
};

// error = colour^(1 - feature): `colour` is the HyAB distance in Hunt-adjusted CIELAB after filtering with
// the eye's contrast sensitivity, `feature` the difference in edges and points; both in [0, 1]. Symmetric in
// its arguments. `mask`, unless empty, says over which pixels the mean is; the filters reach some pixels
// beyond them. Throws kBadInput unless both are 8-bit sRGB of one size, the mask's too, which uses some
// pixel.
FlipMap Flip(const io::Image& a,
             const io::Image& b,
             const FlipOptions& options = {},
             const io::Mask& mask = {});

}  // namespace nerf
