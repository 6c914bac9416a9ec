// The camera models that a capture may need, from the simplest on.
#pragma once

#include <string>
#include <vector>

#include "sfm/bundle/intrinsics.h"

namespace sfm {

// One enlargement of the camera model.
struct CameraStep {
  std::string name, parameters;  // of COLMAP's camera model; what is added to it
  FreeIntrinsics added;
  double min_fall;  // share by which the error of held-out observations must fall

  std::string Title() const { return name.empty() ? parameters : name + " (" + parameters + ")"; }
};

// SIMPLE_RADIAL, RADIAL, OPENCV: each adds to the one before, the first to SIMPLE_PINHOLE.
const std::vector<CameraStep>& CameraLadder();

// Both at once: what the second leads to.
CameraStep Joined(const CameraStep& first, const CameraStep& second);

// May be added to any of them.
const CameraStep& PrincipalPointStep();

// A focal length per picture instead of one for all pictures of a camera: autofocus, zoom.
const CameraStep& OwnFocalsStep();

// Frees what either frees, in the lens of `a`.
FreeIntrinsics Union(const FreeIntrinsics& a, const FreeIntrinsics& b);

// `camera` without what the model of `free` does not have.
io::Camera Reduced(io::Camera camera, const FreeIntrinsics& free);

// Throws io::Error kUsage for a camera model that is not supported.
FreeIntrinsics FreeParametersOf(const std::string& camera_model);

}  // namespace sfm
