#include "io/scene/places.h"

#include <algorithm>

namespace io {
namespace {

// Of the distance from the origin.
constexpr double kRounding = 1e-6;

bool IsSamePlace(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (a - b).norm() <= kRounding * (1 + a.norm());
}

}  // namespace

std::vector<std::size_t> FirstAtPlace(const std::vector<Frame>& frames) {
  std::vector<std::size_t> first(frames.size()), places;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto known = std::find_if(places.begin(), places.end(), [&](std::size_t place) {
      return IsSamePlace(frames[place].world_from_cam.translation, frames[i].world_from_cam.translation);
    });
    first[i] = known != places.end() ? *known : i;
    if (first[i] == i) places.push_back(i);
  }
  return first;
}

}  // namespace io
