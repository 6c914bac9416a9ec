// The intrinsics of one frame of a transforms.json.
#pragma once

#include <filesystem>

#include "io/base/json_reader.h"
#include "io/scene/scene.h"

namespace io {

// Keys may stand on the top level, in the frame, or alike in both. The picture's own size must equal w and h
// when they are stated; the focal length comes from fl_* (pixels), camera_angle_* (radians) or *_fov
// (degrees), which must agree to 0.1 %; one axis stands for both when the other is silent; the principal
// point defaults to the middle. Throws kBadInput, also for fisheye and higher-order distortion ("undistort
// first").
Camera ReadTransformsCamera(const JsonReader& top,
                            const JsonReader& frame,
                            const std::filesystem::path& image_path);

}  // namespace io
