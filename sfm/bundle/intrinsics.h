// A camera's parameters as bundle adjustment sees them, and which of them it may change.
#pragma once

#include <string>
#include <vector>

#include "io/scene/scene.h"

namespace sfm {

// fl_x and cx, cy in pixels; fl_y = aspect * fl_x, so that one focal length can be free while pixels stay as
// square as they were.
enum Intrinsic { kFocal, kAspect, kCx, kCy, kK1, kK2, kP1, kP2, kIntrinsics };
using IntrinsicVector = Eigen::Matrix<double, kIntrinsics, 1>;
// All but the focal length: what stays when a lens is focused anew.
constexpr int kLensIntrinsics = kIntrinsics - 1;

struct FreeIntrinsics {
  bool focal = false, aspect = false, principal_point = false, k1 = false, k2 = false, tangential = false;
  // Index of the camera whose lens (all but the focal length) this one has, too: both start with the same
  // values and free the same ones. -1: a lens of its own.
  int lens_of = -1;

  bool operator==(const FreeIntrinsics&) const = default;
};

// The free parameters, in the order of Intrinsic.
std::vector<int> FreeIndices(const FreeIntrinsics& free);

// The camera whose lens each camera has: its own index or lens_of.
std::vector<std::size_t> LensOwners(const std::vector<FreeIntrinsics>& free);

IntrinsicVector ToVector(const io::Camera& camera);

// `camera` with these parameters; bit for bit the same camera when they are its own.
io::Camera WithIntrinsics(const io::Camera& camera, const IntrinsicVector& intrinsics);

}  // namespace sfm
