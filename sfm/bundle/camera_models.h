// The camera models that a capture may need, in the order of their freedom.
#pragma once

#include <string>
#include <vector>

#include "sfm/bundle/intrinsics.h"

namespace sfm {

// Parameters that a camera model may be extended by.
struct CameraExtension {
  std::string model;       // COLMAP's name of what it leads to; empty: it changes no name
  std::string parameters;  // that are added
  FreeIntrinsics added;
  double min_fall;  // share by which the error of held-out observations must fall

  std::string Title() const { return model.empty() ? parameters : model + " (" + parameters + ")"; }
};

// SIMPLE_RADIAL, RADIAL, OPENCV: each extends the one before, the first SIMPLE_PINHOLE.
const std::vector<CameraExtension>& CameraModels();

// Both at once: what the second leads to.
CameraExtension Joined(const CameraExtension& first, const CameraExtension& second);

// May be added to any of them.
const CameraExtension& PrincipalPointExtension();

// A focal length per picture instead of one for all pictures of a camera: autofocus, zoom.
const CameraExtension& OwnFocalsExtension();

// Frees what either frees, in the lens of `a`.
FreeIntrinsics Union(const FreeIntrinsics& a, const FreeIntrinsics& b);

// `camera` without what the model of `free` does not have.
io::Camera Reduced(io::Camera camera, const FreeIntrinsics& free);

// Throws io::Error kUsage for a camera model that is not supported.
FreeIntrinsics FreeParametersOf(const std::string& camera_model);

}  // namespace sfm
