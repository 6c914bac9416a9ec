// A camera's parameters as bundle adjustment sees them, and which of them it may change.
#pragma once

#include <string>
#include <vector>

#include "io/scene.h"

namespace sfm {

// fl_x and cx, cy in pixels; fl_y = aspect * fl_x, so that one focal length can be free while pixels stay as
// square as they were.
enum Intrinsic { kFocal, kAspect, kCx, kCy, kK1, kK2, kP1, kP2, kIntrinsics };
using IntrinsicVector = Eigen::Matrix<double, kIntrinsics, 1>;

struct FreeIntrinsics {
  bool focal = false, aspect = false, principal_point = false, k1 = false, k2 = false, tangential = false;

  bool operator==(const FreeIntrinsics&) const = default;
};

// The free and the held parameters, in the order of Intrinsic.
std::vector<int> FreeIndices(const FreeIntrinsics& free);
std::vector<int> HeldIndices(const FreeIntrinsics& free);

IntrinsicVector ToVector(const io::Camera& camera);

// `camera` with these parameters; bit for bit the same camera when they are its own.
io::Camera WithIntrinsics(const io::Camera& camera, const IntrinsicVector& intrinsics);

}  // namespace sfm
