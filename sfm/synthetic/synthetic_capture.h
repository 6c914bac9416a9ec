// Captures made of numbers instead of pictures, with their truth: what a perfect detector and a matcher with
// a chosen share of mistakes would hand to two-view verification and mapping. After COLMAP's
// SynthesizeDataset and SynthesizeNoise (scene/synthetic.h), with the hard cases that it lacks.
#pragma once

#include <vector>

#include "io/scene/scene.h"
#include "sfm/features/matching.h"
#include "sfm/reconstruction.h"
#include "sfm/synthetic/capture_options.h"

namespace sfm {

struct SyntheticCapture {
  std::vector<Picture> pictures;
  // No descriptors. First come the true points that the picture sees, in the order of truth.points, one
  // keypoint each; then those on the second rigid body, then those of the overlay.
  std::vector<Features> features;
  std::vector<PairMatches> matches;  // pairs without any match are left out
  // Frames in the order of the pictures, image paths are their names. Points are in double; frame_indices
  // say who sees them.
  io::Scene truth;
};

// The result depends on nothing but the options; the seed draws cameras, points, noise and outliers from
// streams of their own, so that more noise leaves the world as it is. A point is seen when it lies in front
// of the camera, inside the picture, and where the distortion is invertible. Of the n matches of a pair,
// round(outlier_share * n) are wrong; fewer where a pair sees too little of the second body.
SyntheticCapture MakeSyntheticCapture(const CaptureOptions& options);

}  // namespace sfm
