// The path along the cameras, for captures without a subject in the middle.
#include <algorithm>
#include <cmath>
#include <limits>

#include "io/base/median.h"
#include "nerf/paths/path_shapes.h"

namespace nerf {
namespace {

// A capture is in no order of its own when from neighbour to neighbour takes less than this share of its way.
constexpr double kDisorder = 0.5;
// A step of more than so many median ones is a jump.
constexpr double kJump = 3;
// Half-width of the smoothing, in median steps: evens out a hand, keeps a corner.
constexpr double kSmoothingSteps = 1.5;
// Poses per median step before smoothing, at most kMaxFine in all.
constexpr double kFinePerStep = 4;
constexpr double kMaxFine = 4000;
// Share of the film in which the camera gathers speed, and at the end loses it.
constexpr double kEase = 0.12;

using Poses = std::vector<io::Rigid3d>;

std::vector<double> Steps(const Poses& poses, double depth) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < poses.size(); ++i) steps.push_back(Motion(poses[i - 1], poses[i], depth));
  return steps;
}

double Sum(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum;
}

// From the camera furthest from the middle, always to the nearest that is left.
Poses FromNeighbourToNeighbour(Poses left, const CaptureGeometry& capture) {
  Poses order;
  auto next = std::max_element(left.begin(), left.end(), [&](const io::Rigid3d& a, const io::Rigid3d& b) {
    return (a.translation - capture.centre).norm() < (b.translation - capture.centre).norm();
  });
  while (true) {
    const io::Rigid3d here = *next;
    order.push_back(here);
    left.erase(next);
    if (left.empty()) return order;
    next = std::min_element(left.begin(), left.end(), [&](const io::Rigid3d& a, const io::Rigid3d& b) {
      return Motion(here, a, capture.depth) < Motion(here, b, capture.depth);
    });
  }
}

// The way from one camera to another with the least sum of squared steps: many small ones, where cameras
// stand between (Dijkstra). Without the first camera.
Poses WayBetween(const Poses& cameras, std::size_t from, std::size_t to, double depth) {
  const std::size_t n = cameras.size();
  std::vector<double> cost(n, std::numeric_limits<double>::infinity());
  std::vector<std::size_t> previous(n, from);
  std::vector<bool> done(n, false);
  cost[from] = 0;
  for (std::size_t round = 0; round < n && !done[to]; ++round) {
    std::size_t here = n;
    for (std::size_t i = 0; i < n; ++i) {
      if (!done[i] && (here == n || cost[i] < cost[here])) here = i;
    }
    done[here] = true;
    for (std::size_t i = 0; i < n; ++i) {
      const double step = Motion(cameras[here], cameras[i], depth), through = cost[here] + step * step;
      if (done[i] || !(through < cost[i])) continue;
      cost[i] = through;
      previous[i] = here;
    }
  }
  Poses way;
  for (std::size_t i = to; i != from; i = previous[i]) way.push_back(cameras[i]);
  std::reverse(way.begin(), way.end());
  return way;
}

Poses BridgeJumps(const Poses& order, double depth) {
  const std::vector<double> steps = Steps(order, depth);
  const double typical = io::Median(steps);
  Poses bridged = {order[0]};
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (steps[i - 1] > kJump * typical) {
      const Poses way = WayBetween(order, i - 1, i, depth);
      bridged.insert(bridged.end(), way.begin(), way.end());
    } else {
      bridged.push_back(order[i]);
    }
  }
  return bridged;
}

// `count` poses along the polyline `nodes`, at shares(i) of its length.
template <typename Shares>
Poses Along(const Poses& nodes, double depth, int count, const Shares& shares) {
  const std::vector<double> steps = Steps(nodes, depth);
  const double length = Sum(steps);
  Poses poses;
  std::size_t step = 0;
  double before = 0;  // length up to the step
  for (int i = 0; i < count; ++i) {
    const double at = length * shares(i);
    while (step + 1 < steps.size() && before + steps[step] < at) before += steps[step++];
    const double share = steps[step] > 0 ? (at - before) / steps[step] : 0;
    poses.push_back(Between(nodes[step], nodes[step + 1], std::clamp(share, 0.0, 1.0)));
  }
  return poses;
}

// Gaussian mean over neighbours, `sigma` poses wide.
Poses Smoothed(const Poses& fine, double sigma) {
  const int n = static_cast<int>(fine.size()), reach = static_cast<int>(3 * sigma);
  Poses smooth;
  for (int i = 0; i < n; ++i) {
    // As far to one side as to the other: the ends stay where they are.
    const int wide = std::min({reach, i, n - 1 - i});
    std::vector<double> weights;
    for (int k = -wide; k <= wide; ++k) weights.push_back(std::exp(-0.5 * k * k / (sigma * sigma)));
    const auto first = static_cast<std::size_t>(i - wide);
    smooth.push_back(MeanPose(std::span(fine).subspan(first, weights.size()), weights));
  }
  return smooth;
}

// Share of the way after a share of the time: speed rises evenly over kEase, is constant, falls evenly.
double Eased(double time) {
  const double top = 1 / (1 - kEase);
  const auto rise = [&](double t) { return 0.5 * top * t * t / kEase; };
  if (time < kEase) return rise(time);
  if (time > 1 - kEase) return 1 - rise(1 - time);
  return top * (time - 0.5 * kEase);
}

}  // namespace

void FitWalk(const std::vector<io::Rigid3d>& cameras, int frames, CameraPath* path) {
  path->kind = PathKind::kWalk;
  const double depth = path->capture.depth;
  const Poses neighbours = FromNeighbourToNeighbour(cameras, path->capture);
  const bool ordered = Sum(Steps(neighbours, depth)) > kDisorder * Sum(Steps(cameras, depth));
  const Poses nodes = BridgeJumps(ordered ? cameras : neighbours, depth);
  const std::vector<double> steps = Steps(nodes, depth);
  // Of cameras that stand in pairs, both may be 0.
  const double step = std::max(io::Median(steps), path->capture.spacing);
  const double in_steps = step > 0 ? Sum(steps) / step : static_cast<double>(steps.size());
  const int n_fine = static_cast<int>(std::clamp(kFinePerStep * in_steps, 2.0, kMaxFine));
  const auto evenly = [&](int i) { return static_cast<double>(i) / (n_fine - 1); };
  const double sigma = kSmoothingSteps * (n_fine - 1) / std::max(in_steps, 1.0);
  const Poses smooth = Smoothed(Along(nodes, depth, n_fine, evenly), sigma);
  path->world_from_cam =
      Along(smooth, depth, frames, [&](int i) { return Eased(static_cast<double>(i) / (frames - 1)); });
}

}  // namespace nerf
