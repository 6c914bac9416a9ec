// Support for tests: blocks of a synthetic model.
#pragma once

#include <map>
#include <vector>

#include "tests/support/scenes/sfm_synthetic_model.h"

// Pictures [first, end) of one ring, with what they see of its points; those that fewer than 3 of them see
// are left out.
inline io::ColmapModel PartOf(const io::ColmapModel& whole, int first, int end) {
  io::ColmapModel part;
  part.scene.cameras = whole.scene.cameras;
  part.scene.frames.assign(whole.scene.frames.begin() + first, whole.scene.frames.begin() + end);
  std::map<int, std::vector<io::Observation>> tracks;
  for (io::Observation o : whole.observations) {
    if (o.frame_index < first || o.frame_index >= end) continue;
    o.frame_index -= first;
    tracks[o.point_index].push_back(o);
  }
  for (auto& [point, track] : tracks) {
    if (track.size() < 3) continue;
    for (io::Observation& o : track) {
      o.point_index = static_cast<int>(part.scene.points.size());
      part.observations.push_back(o);
    }
    part.scene.points.push_back({.xyz = whole.scene.points[static_cast<std::size_t>(point)].xyz});
  }
  return part;
}
