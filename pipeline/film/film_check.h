// What a viewer of the film would stumble over: jumps, and frames that do not belong between their
// neighbours.
#pragma once

#include <string>
#include <vector>

#include "io/image/image.h"
#include "nerf/paths/camera_path.h"

namespace pipeline {

// A frame of the film as few mean colours, the same size for all frames of one film.
std::string Thumbnail(const io::Image& frame);

struct FilmFaults {
  std::vector<int> jumps;  // first frames after a jump, from 0
  std::vector<int> lone;   // frames unlike both neighbours, which are alike
};

// Compares each frame with the next ones; a film of fewer than 3 frames has no faults.
FilmFaults FaultsOf(const std::vector<std::string>& thumbnails);

// A line on how even the fitted path is, and warnings that name the frames by the numbers of their files.
std::vector<std::string> CheckPath(const nerf::CameraPath& path);
std::vector<std::string> CheckFrames(const std::vector<std::string>& thumbnails);

}  // namespace pipeline
