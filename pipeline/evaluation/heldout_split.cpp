#include "pipeline/evaluation/heldout_split.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "io/scene/places.h"

namespace pipeline {
namespace {

using Eigen::Vector3d;

// How differently two pictures were taken, for each frame against `frame`.
std::vector<double> DifferencesFrom(const std::vector<io::Frame>& frames, std::size_t frame) {
  Vector3d centre = Vector3d::Zero();
  for (const io::Frame& f : frames)
    centre += f.world_from_cam.translation / static_cast<double>(frames.size());
  double radius = 0;
  for (const io::Frame& f : frames) radius = std::max(radius, (f.world_from_cam.translation - centre).norm());
  std::vector<double> differences;
  const io::Rigid3d& from = frames[frame].world_from_cam;
  for (const io::Frame& f : frames) {
    const double distance = (f.world_from_cam.translation - from.translation).norm();
    const double cosine =
        (f.world_from_cam.rotation * Vector3d::UnitZ()).dot(from.rotation * Vector3d::UnitZ());
    differences.push_back((radius > 0 ? distance / radius : 0) + std::acos(std::clamp(cosine, -1.0, 1.0)));
  }
  return differences;
}

// Counts places, so that views of one panorama have the same number; or frames, where there are few places.
std::vector<std::size_t> PlaceNumbers(const std::vector<io::Frame>& frames, std::size_t fewest) {
  const std::vector<std::size_t> first = io::FirstAtPlace(frames);
  std::vector<std::size_t> numbers(frames.size());
  std::size_t n_places = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) numbers[i] = first[i] == i ? n_places++ : numbers[first[i]];
  if (n_places < fewest) std::iota(numbers.begin(), numbers.end(), std::size_t{0});
  return numbers;
}

}  // namespace

std::vector<bool> HeldOutFrames(const std::vector<io::Frame>& frames, const std::string& holdout, int every) {
  const std::size_t n = frames.size(), step = static_cast<std::size_t>(every);
  std::vector<bool> is_held_out(n, false);
  if (holdout == "every") {
    const std::vector<std::size_t> places = PlaceNumbers(frames, step);
    for (std::size_t i = 0; i < n; ++i) is_held_out[i] = places[i] % step == 0;
    return is_held_out;
  }
  if (n == 0) return is_held_out;
  const std::vector<double> differences = DifferencesFrom(frames, n / 2);
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return differences[a] < differences[b];
  });
  for (std::size_t i = 0; i < (n + step - 1) / step; ++i) is_held_out[order[i]] = true;
  return is_held_out;
}

io::Scene SetAside(int every, io::Scene* scene) {
  io::Scene aside = *scene;
  aside.frames.clear();
  aside.points.clear();
  std::vector<io::Frame> kept;
  std::vector<int> new_index;
  for (std::size_t i = 0; i < scene->frames.size(); ++i) {
    const bool is_kept = (i + 1) % static_cast<std::size_t>(every) != 0;
    new_index.push_back(is_kept ? static_cast<int>(kept.size()) : -1);
    (is_kept ? kept : aside.frames).push_back(scene->frames[i]);
  }
  scene->frames = std::move(kept);
  io::RenumberObservers(new_index, &scene->points);
  return aside;
}

}  // namespace pipeline
