#include "nerf/paths/free_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "io/base/median.h"

namespace nerf {
namespace {

// Share of the capture's depth that is to be free before the camera: nearer things fill the picture, blurred.
constexpr double kFreeShare = 0.25;
// Nothing counts as nearer than this share of it: one pixel of fog before the lens is not what is looked at.
constexpr double kNearest = 0.02;
// Nor as farther than so many times it: from there on, sky included, hardly anything moves.
constexpr double kFarthest = 50;
// Pixels a side of a look: one thing of 1/32 of the picture's width is noticed.
constexpr int kLookSide = 32;
// Poses that are looked at along the path, and training views to compare with.
constexpr int kMaxChecks = 90, kMaxReferences = 32;
// A look may be this much worse than nearly all training views: pixels that differ by chance. What was never
// observed is told more surely, and a hundredth of a frame is a dark corner already.
constexpr double kNearSlack = 0.03, kUnobservedSlack = 0.005, kReferenceShare = 0.9;
// How far poses are drawn to the cameras, tried in this order; the rounds that find the nearest cluster.
constexpr std::array<double, 4> kPulls = {0.25, 0.5, 0.75, 1};
constexpr int kClusterRounds = 3;
// A pull is worth leaving the way for if it takes away this share of what was too much.
constexpr double kWorthwhile = 0.5;
// Of the film's length over which a pull comes and goes, so that it is not seen as a jerk.
constexpr double kPullShare = 0.04;

// Looks around from a pose.
class Scout {
 public:
  Scout(
      const TrainedField& field, const io::Scene& train, const SupportMap& support, double depth, int threads)
      : field_(field),
        support_(support),
        camera_(
            SmallCamera(train.cameras[static_cast<std::size_t>(train.frames[0].camera_index)], kLookSide)),
        threads_(threads),
        near_(static_cast<float>(kFreeShare * depth)),
        nearest_(kNearest * depth),
        farthest_(kFarthest * depth) {}

  struct Look {
    double near = 0, unobserved = 0;  // shares of the picture: what the field or splats show near the camera
    double depth = 0;                 // harmonic mean distance
  };

  Look From(const io::Rigid3d& pose) const {
    RenderOptions options{.threads = threads_, .step_scale = 1, .samples_per_pixel = 1, .depth_only = true};
    const RenderedView whole = field_.Render(camera_, pose, options);
    options.limits.end = near_;
    const RenderedView close = field_.Render(camera_, pose, options);
    const std::vector<float> splats = field_.NearSplatOpacity(camera_, pose, near_, threads_);
    Look look;
    for (std::size_t i = 0; i < close.opacity.size(); ++i) {
      const float free = (1 - close.opacity[i]) * (splats.empty() ? 1 : 1 - splats[i]);
      look.near += static_cast<double>(1 - free) / static_cast<double>(close.opacity.size());
    }
    double nearness = 0;
    for (const float depth : whole.depth)
      nearness += 1 / std::min(farthest_, std::max(nearest_, static_cast<double>(depth)));
    look.depth = static_cast<double>(whole.depth.size()) / nearness;
    if (field_.HasUnknownSpace())
      look.unobserved = support_.ObservedIn(camera_, pose, whole, threads_).UnobservedShare();
    return look;
  }

 private:
  const TrainedField& field_;
  const SupportMap& support_;
  const io::Camera camera_;
  const int threads_;
  const float near_;
  const double nearest_, farthest_;
};

// How much worse a look is than what the training views permit; not above 0: fine.
class Standard {
 public:
  Standard(const Scout& scout, const io::Scene& train) {
    const std::size_t stride = (train.frames.size() + kMaxReferences - 1) / kMaxReferences;
    std::vector<double> near, unobserved;
    for (std::size_t i = 0; i < train.frames.size(); i += stride) {
      const Scout::Look look = scout.From(train.frames[i].world_from_cam);
      near.push_back(look.near), unobserved.push_back(look.unobserved);
    }
    near_ = io::Quantile(near, kReferenceShare) + kNearSlack;
    unobserved_ = io::Quantile(unobserved, kReferenceShare) + kUnobservedSlack;
  }
  double Excess(const Scout::Look& look) const {
    return std::max(look.near - near_, look.unobserved - unobserved_);
  }

 private:
  double near_, unobserved_;
};

// The cameras that are nearest to a pose as one pose: means, each around the last, as wide as the cameras
// stand apart (mean shift).
io::Rigid3d NearestCluster(const std::vector<io::Rigid3d>& cameras,
                           const CaptureGeometry& capture,
                           io::Rigid3d pose) {
  std::vector<double> motions(cameras.size()), weights(cameras.size());
  for (int round = 0; round < kClusterRounds; ++round) {
    for (std::size_t i = 0; i < cameras.size(); ++i) motions[i] = Motion(pose, cameras[i], capture.depth);
    const double nearest = *std::min_element(motions.begin(), motions.end());
    // Never narrower than the way to the nearest, where all weights would vanish.
    const double width = std::max({capture.spacing, 0.5 * nearest, 1e-9});
    for (std::size_t i = 0; i < cameras.size(); ++i)
      weights[i] = std::exp(-0.5 * std::pow(motions[i] / width, 2));
    pose = MeanPose(cameras, weights);
  }
  return pose;
}

// What was found at a pose that was looked at.
struct Check {
  double excess = 0, pull = 0;
  double depth = 0;
  io::Rigid3d to_cluster;  // from the pose to the nearest cluster, in the pose's own coordinates
};

// Of every `stride`th pose; with `cameras`, also how far those that are obstructed are to be drawn to them.
std::vector<Check> CheckPoses(const CameraPath& path,
                              int stride,
                              const Scout& scout,
                              const Standard& standard,
                              const std::vector<io::Rigid3d>* cameras) {
  std::vector<Check> checks;
  for (std::size_t i = 0; i < path.world_from_cam.size(); i += static_cast<std::size_t>(stride)) {
    const io::Rigid3d& pose = path.world_from_cam[i];
    const Scout::Look look = scout.From(pose);
    Check check{.excess = std::max(0.0, standard.Excess(look)), .depth = look.depth, .to_cluster = {}};
    if (check.excess > 0 && cameras) {
      const io::Rigid3d cluster = NearestCluster(*cameras, path.capture, pose);
      check.to_cluster = pose.Inverse() * cluster;
      double least = kWorthwhile * check.excess;
      for (const double share : kPulls) {
        const double excess = standard.Excess(scout.From(Between(pose, cluster, share)));
        if (excess < least) least = excess, check.pull = share;
        if (least <= 0) break;
      }
    }
    checks.push_back(check);
  }
  return checks;
}

int CountObstructed(const std::vector<Check>& checks) {
  return static_cast<int>(
      std::count_if(checks.begin(), checks.end(), [](const Check& check) { return check.excess > 0; }));
}

double SumOfExcess(const std::vector<Check>& checks) {
  return std::accumulate(
      checks.begin(), checks.end(), 0.0, [](double sum, const Check& check) { return sum + check.excess; });
}

int Reach(int stride, int frames) {
  return std::max(stride, static_cast<int>(std::lround(kPullShare * frames)));
}

// Pulls per pose, from those at the checked ones: as strong as any near it, and without steps.
std::vector<double> Spread(const std::vector<Check>& checks, int stride, int frames, bool loop) {
  const int reach = Reach(stride, frames);
  const auto index = [&](int i) {
    return loop ? (i % frames + frames) % frames : std::clamp(i, 0, frames - 1);
  };
  std::vector<double> strongest(static_cast<std::size_t>(frames)), spread(static_cast<std::size_t>(frames));
  for (std::size_t k = 0; k < checks.size(); ++k) {
    const int middle = static_cast<int>(k) * stride;
    for (int i = middle - 2 * reach; i <= middle + 2 * reach; ++i) {
      double& at = strongest[static_cast<std::size_t>(index(i))];
      at = std::max(at, checks[k].pull);
    }
  }
  for (int i = 0; i < frames; ++i) {
    double sum = 0, weights = 0;
    for (int k = -2 * reach; k <= 2 * reach; ++k) {
      const double weight = std::exp(-0.5 * std::pow(static_cast<double>(k) / reach, 2));
      sum += weight * strongest[static_cast<std::size_t>(index(i + k))];
      weights += weight;
    }
    spread[static_cast<std::size_t>(i)] = sum / weights;
  }
  return spread;
}

// Draws every pose to where the checked poses around it would be drawn in the mean. One cluster lies ahead of
// some of them and behind others: drawn to it alone, the path would halt there and leap to the next one.
void DrawToCameras(const std::vector<Check>& checks, int stride, CameraPath* path) {
  const int frames = static_cast<int>(path->world_from_cam.size()), reach = Reach(stride, frames);
  const std::vector<double> pulls = Spread(checks, stride, frames, path->IsLoop());
  std::vector<io::Rigid3d> ways;
  std::vector<int> places;
  for (std::size_t k = 0; k < checks.size(); ++k) {
    if (checks[k].pull > 0)
      ways.push_back(checks[k].to_cluster), places.push_back(static_cast<int>(k) * stride);
  }
  std::vector<double> weights(ways.size());
  for (int i = 0; i < frames; ++i) {
    const double pull = pulls[static_cast<std::size_t>(i)];
    if (!(pull > 0)) continue;
    for (std::size_t k = 0; k < ways.size(); ++k) {
      int apart = std::abs(i - places[k]);
      if (path->IsLoop()) apart = std::min(apart, frames - apart);
      weights[k] = std::exp(-0.5 * std::pow(static_cast<double>(apart) / reach, 2));
    }
    io::Rigid3d& pose = path->world_from_cam[static_cast<std::size_t>(i)];
    pose = pose * Between({}, MeanPose(ways, weights), pull);
  }
}

// What is found after drawing.
std::vector<Check> DrawAndCheck(const std::vector<Check>& checks,
                                int stride,
                                const Scout& scout,
                                const Standard& standard,
                                CameraPath* path) {
  DrawToCameras(checks, stride, path);
  return CheckPoses(*path, stride, scout, standard, nullptr);
}

// Depths of all poses, from those that were looked at.
std::vector<double> DepthsOf(const std::vector<Check>& checks, int stride, const CameraPath& path) {
  std::vector<double> depths;
  for (std::size_t i = 0; i < path.world_from_cam.size(); ++i) {
    const double at = static_cast<double>(i) / stride;
    const auto before = static_cast<std::size_t>(at);
    const std::size_t after =
        path.IsLoop() ? (before + 1) % checks.size() : std::min(before + 1, checks.size() - 1);
    const double share = at - static_cast<double>(before);
    depths.push_back((1 - share) * checks[before].depth + share * checks[after].depth);
  }
  return depths;
}

}  // namespace

FreePathReport KeepFree(const TrainedField& field,
                        const io::Scene& train,
                        const SupportMap& support,
                        int threads,
                        CameraPath* path) {
  const Scout scout(field, train, support, path->capture.depth, threads);
  const Standard standard(scout, train);
  const std::vector<io::Rigid3d> cameras = PosesOf(train);
  const int frames = static_cast<int>(path->world_from_cam.size()),
            stride = (frames + kMaxChecks - 1) / kMaxChecks;
  std::vector<Check> checks = CheckPoses(*path, stride, scout, standard, &cameras);
  FreePathReport report{.checked = static_cast<int>(checks.size()), .obstructed = CountObstructed(checks)};
  if (report.obstructed > 0) {
    CameraPath drawn = *path;
    std::vector<Check> drawn_checks = DrawAndCheck(checks, stride, scout, standard, &drawn);
    // What neighbours, which are drawn elsewhere, keep from getting better stays on the way.
    for (std::size_t k = 0; k < checks.size(); ++k) {
      if (drawn_checks[k].excess > kWorthwhile * checks[k].excess) checks[k].pull = 0;
    }
    drawn = *path;
    drawn_checks = DrawAndCheck(checks, stride, scout, standard, &drawn);
    if (SumOfExcess(drawn_checks) < SumOfExcess(checks)) {
      *path = std::move(drawn);
      checks = std::move(drawn_checks);
    }
    report.remaining = CountObstructed(checks);
  }
  path->depths = DepthsOf(checks, stride, *path);
  return report;
}

}  // namespace nerf
