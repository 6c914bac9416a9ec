// How far the observations determine the poses and camera parameters of an adjusted model.
#pragma once

#include <vector>

#include "io/scene/colmap_model.h"
#include "sfm/bundle/intrinsics.h"

namespace sfm {

struct PoseUncertainty {
  double rotation_deg = 0;  // RMS angle of the rotation's error
  double centre = 0;        // RMS error of the camera centre as a share of the extent of all camera centres
};

struct BundleUncertainty {
  double sigma0_px = 0;  // of one coordinate of an observation whose Observation::sigma is 1 with weight 1
  // Standard deviation per camera, in the order of Intrinsic; 0 where held. Infinite in a camera without
  // observations.
  std::vector<IntrinsicVector> intrinsics;
  std::vector<PoseUncertainty> poses;  // per frame; infinite without observations. Empty unless asked for.
};

// Covariance of a minimum of AdjustBundle: with the Jacobian J of all residuals, the weights W = rho', and
// the points eliminated by the Schur complement,
//   S = U - sum over points of W_i V_i^-1 W_i^T,    covariance of poses and intrinsics = sigma0^2 S^+.
// S has the 7 directions of a similarity of the world as null space; the pseudo-inverse S^+ leaves them out.
// That is the gauge of the free network (Triggs et al. 2000, section 9): errors of a pose count relative to
// all poses in common, and no frame is special. Intrinsics do not depend on the gauge. sigma0^2 is Huber's
// estimate for an M-estimator ("Robust Statistics", 1981, section 7.6) of n observations and p parameters,
//   sigma0^2 = K^2 sum(w^2 s) / (2 n - p) * mean(w) / m^2,    K = 1 + p / (2 n) * var(psi') / m^2,
// with s the squared errors, w = rho'(s), and psi' the slope of the influence function w r, across and along
// the residual r: w and w - 2 s w^2 for Cauchy's loss; m is its mean.
// Extent: the largest distance of a centre from the mean of the centres.
//
// Frames that move together (AdjustmentOptions::moves_with) have one pose, and its uncertainty.
// A direction that the observations do not determine comes out with a very large, finite sigma. Cost: a dense
// matrix of 6 rows per frame; with poses 3 times the factorisation (0.1 s at 100 frames, 10 s at 500).
BundleUncertainty EstimateUncertainty(const io::ColmapModel& model,
                                      const std::vector<FreeIntrinsics>& free,
                                      bool with_poses,
                                      const std::vector<std::size_t>& moves_with = {});

}  // namespace sfm
