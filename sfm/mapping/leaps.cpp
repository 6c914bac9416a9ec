#include "sfm/mapping/leaps.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace sfm {
namespace {

constexpr std::size_t kOverlapping = 3;  // farther apart in the order, pictures need not overlap
constexpr std::size_t kMinSteps = 10;    // fewer tell no habit
constexpr double kMinTurnDeg = 60, kTurnFactor = 3, kMoveFactor = 6;
constexpr double kMinSharedPoints = 0.1;

struct Step {
  double turn_deg = 0, move = 0;
  bool is_between_following = false;
};

// Nine in ten of the values are at most as large.
double NineInTen(std::vector<double> values) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) * 9 / 10);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Of frames[i] of `order` to the next one.
std::vector<Step> Steps(const io::Scene& scene,
                        const std::vector<std::size_t>& order,
                        const std::vector<std::size_t>& positions) {
  std::vector<Step> steps;
  for (std::size_t i = 0; i + 1 < order.size(); ++i) {
    const io::Rigid3d &a = scene.frames[order[i]].world_from_cam,
                      &b = scene.frames[order[i + 1]].world_from_cam;
    steps.push_back({Eigen::AngleAxisd(a.rotation.transpose() * b.rotation).angle() * 180 / std::numbers::pi,
                     (a.translation - b.translation).norm(),
                     positions[i + 1] - positions[i] <= kOverlapping});
  }
  return steps;
}

// The part that each frame of `order` belongs to.
std::vector<int> Parts(const std::vector<Step>& steps) {
  std::vector<double> turns, moves;
  for (const Step& step : steps) {
    if (!step.is_between_following) continue;
    turns.push_back(step.turn_deg);
    moves.push_back(step.move);
  }
  std::vector<int> parts(steps.size() + 1, 0);
  if (turns.size() < kMinSteps) return parts;
  const double turn = std::max(kMinTurnDeg, kTurnFactor * NineInTen(turns)),
               move = kMoveFactor * NineInTen(moves);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const bool leaps = steps[i].is_between_following && (steps[i].turn_deg > turn || steps[i].move > move);
    parts[i + 1] = parts[i] + leaps;
  }
  return parts;
}

}  // namespace

std::set<std::string> PicturesBeyondLeaps(const io::Scene& scene, const std::vector<std::string>& names) {
  std::map<std::string, std::size_t> frame_of;
  for (std::size_t i = 0; i < scene.frames.size(); ++i) frame_of[scene.frames[i].image_path.string()] = i;
  std::vector<std::size_t> order, positions;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto frame = frame_of.find(names[i]);
    if (frame == frame_of.end()) continue;
    order.push_back(frame->second);
    positions.push_back(i);
  }
  if (order.empty()) return {};
  const std::vector<int> parts = Parts(Steps(scene, order, positions));
  const auto n_parts = static_cast<std::size_t>(parts.back()) + 1;
  std::vector<std::size_t> part_of(scene.frames.size(), 0), size(n_parts, 0);
  for (std::size_t i = 0; i < order.size(); ++i) {
    part_of[order[i]] = static_cast<std::size_t>(parts[i]);
    ++size[part_of[order[i]]];
  }
  std::vector<int> seen(n_parts, 0), shared(n_parts, 0);
  for (const io::Point3D& point : scene.points) {
    std::set<std::size_t> seeing;
    for (const int frame : point.frame_indices) seeing.insert(part_of[static_cast<std::size_t>(frame)]);
    for (const std::size_t part : seeing) {
      ++seen[part];
      shared[part] += seeing.size() > 1;
    }
  }
  const auto largest = static_cast<std::size_t>(std::max_element(size.begin(), size.end()) - size.begin());
  std::set<std::string> beyond;
  for (const io::Frame& frame : scene.frames) {
    const std::size_t part = part_of[static_cast<std::size_t>(&frame - scene.frames.data())];
    if (part != largest && shared[part] < kMinSharedPoints * seen[part])
      beyond.insert(frame.image_path.string());
  }
  return beyond;
}

}  // namespace sfm
