// A camera path through keyframes that someone set.
#pragma once

#include <span>
#include <vector>

#include "io/scene/scene.h"

namespace nerf {

struct Keyframe {
  io::Rigid3d world_from_cam;  // OpenGL axes
  double fov_y = 0;            // full vertical angle of view, radians
};

// `frames` cameras from the first keyframe to the last or, in a loop, to before the first again: Catmull-Rom
// splines of place, orientation (quaternions, the shorter way) and angle of view, with equal time between
// keyframes. At least one keyframe; frames >= 1.
std::vector<Keyframe> InterpolateKeyframes(std::span<const Keyframe> keyframes, int frames, bool is_loop);

// The pinhole camera of a picture, its principal point in the middle.
io::Camera CameraOfView(int width, int height, double fov_y);

}  // namespace nerf
