#include "nerf/paths/even_path.h"

#include <algorithm>

#include "io/base/check.h"
#include "io/base/median.h"

namespace nerf {
namespace {

// Nowhere faster than so many median steps: less than the 2 that an even film may show, because the median
// falls where others become slower.
constexpr double kFastest = 1.5;
// Nor slower than this share of it is asked for: where the fitted path rests, at its ends, a drawn one may
// not, and would take without end.
constexpr double kSlowest = 0.05;

std::vector<double> StepsBetween(std::span<const io::Rigid3d> poses,
                                 const std::vector<double>& depths,
                                 double depth,
                                 bool loop) {
  const std::size_t n = poses.size();
  std::vector<double> steps;
  for (std::size_t i = 0; i + (loop ? 0 : 1) < n; ++i) {
    const std::size_t next = (i + 1) % n;
    steps.push_back(Motion(poses[i], poses[next], depths.empty() ? depth : 0.5 * (depths[i] + depths[next])));
  }
  return steps;
}

}  // namespace

std::vector<double> StepsOf(const CameraPath& path) {
  return StepsBetween(path.world_from_cam, path.depths, path.capture.depth, path.IsLoop());
}

void Retime(std::span<const io::Rigid3d> fitted, int frames, CameraPath* path) {
  const std::vector<io::Rigid3d>& poses = path->world_from_cam;
  PIPELINE_CHECK(fitted.size() == poses.size() && poses.size() >= 2 && frames >= 2);
  const bool loop = path->IsLoop();
  const std::vector<double> steps = StepsOf(*path),
                            wanted = StepsBetween(fitted, {}, path->capture.depth, loop);
  const double typical = io::Median(wanted);
  std::vector<double> times = {0};  // at which each pose is reached
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double speed = std::clamp(wanted[i], kSlowest * typical, kFastest * typical);
    times.push_back(times.back() + (speed > 0 ? steps[i] / speed : 1));
  }
  CameraPath timed = *path;
  timed.world_from_cam.clear();
  timed.depths.clear();
  std::size_t step = 0;
  for (int i = 0; i < frames; ++i) {
    const double at = times.back() * i / (loop ? frames : frames - 1);
    while (step + 1 < steps.size() && times[step + 1] <= at) ++step;
    const double length = times[step + 1] - times[step];
    const double share = length > 0 ? std::clamp((at - times[step]) / length, 0.0, 1.0) : 0;
    const std::size_t next = (step + 1) % poses.size();
    timed.world_from_cam.push_back(Between(poses[step], poses[next], share));
    if (!path->depths.empty())
      timed.depths.push_back((1 - share) * path->depths[step] + share * path->depths[next]);
  }
  *path = std::move(timed);
}

double UsualStep(const std::vector<double>& steps, int i) {
  const int n = static_cast<int>(steps.size()), first = std::max(0, i - kJumpWindow),
            last = std::min(n, i + kJumpWindow + 1);
  return std::max(io::Median(steps), io::Median(std::vector(steps.begin() + first, steps.begin() + last)));
}

std::vector<int> JumpsAmong(const std::vector<double>& steps) {
  std::vector<int> jumps;
  for (int i = 0; i < static_cast<int>(steps.size()); ++i) {
    if (steps[static_cast<std::size_t>(i)] > kJumpMedians * UsualStep(steps, i)) jumps.push_back(i);
  }
  return jumps;
}

}  // namespace nerf
