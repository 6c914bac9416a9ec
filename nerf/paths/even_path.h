// How fast the film's camera moves, as its viewer sees it, and a film without jumps.
//
// A step from one frame to the next shows the motion hypot(translation / depth, rotation) in radians, see
// Motion(); depth is the harmonic mean distance of what the picture shows, so that translation / depth is the
// mean parallax of its pixels.
#pragma once

#include <span>
#include <vector>

#include "nerf/paths/camera_path.h"

namespace nerf {

// From each pose to the next and, in a loop, from the last to the first. Without depths that of the capture
// counts everywhere.
std::vector<double> StepsOf(const CameraPath& path);

// The way of the path in `frames` poses, timed anew: as fast as the poses `fitted`, as many as the path has,
// were at the same place, but nowhere much faster than they were as a rule. A path that was drawn to the
// cameras halts and leaps without. Needs as many depths as poses, or none.
void Retime(std::span<const io::Rigid3d> fitted, int frames, CameraPath* path);

// Which values are more than kJumpMedians times as large as the median of all, and as that of the kJumpWindow
// values before and after: what a viewer sees as a jump, not as a faster part.
std::vector<int> JumpsAmong(const std::vector<double>& steps);
inline constexpr double kJumpMedians = 3;
inline constexpr int kJumpWindow = 15;  // half a second at the usual 30 frames per second

// The median of all values or, where larger, of those around value i.
double UsualStep(const std::vector<double>& steps, int i);

}  // namespace nerf
