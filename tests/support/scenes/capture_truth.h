// Support for tests: which true point each keypoint of a synthetic capture shows.
#pragma once

#include <vector>

#include "sfm/synthetic/synthetic_capture.h"

inline Eigen::Vector2d At(const sfm::Keypoint& keypoint) { return {keypoint.x, keypoint.y}; }

// For each picture the true point of each keypoint; -1 behind the last of them.
inline std::vector<std::vector<int>> PointsOfKeypoints(const sfm::SyntheticCapture& capture) {
  std::vector<std::vector<int>> points(capture.pictures.size());
  for (std::size_t i = 0; i < capture.truth.points.size(); ++i) {
    for (const int frame : capture.truth.points[i].frame_indices)
      points[static_cast<std::size_t>(frame)].push_back(static_cast<int>(i));
  }
  for (std::size_t k = 0; k < points.size(); ++k) points[k].resize(capture.features[k].keypoints.size(), -1);
  return points;
}

// Share of the matches of a pair that do not join keypoints of one true point.
inline double WrongShare(const sfm::SyntheticCapture& capture, const sfm::PairMatches& pair) {
  const auto points = PointsOfKeypoints(capture);
  int wrong = 0;
  for (const auto& [in_a, in_b] : pair.matches) {
    const int a = points[static_cast<std::size_t>(pair.a)].at(static_cast<std::size_t>(in_a));
    const int b = points[static_cast<std::size_t>(pair.b)].at(static_cast<std::size_t>(in_b));
    wrong += a < 0 || a != b;
  }
  return wrong / static_cast<double>(pair.matches.size());
}
