#include "nerf/rendering/free_path.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "io/base/median.h"

namespace nerf {
namespace {

// Share of the capture's depth that is to be free before the camera: nearer things fill the picture, blurred.
constexpr double kFreeShare = 0.25;
// Pixels a side of a look: one thing of 1/32 of the picture's width is noticed.
constexpr int kLookSide = 32;
// Poses that are looked at along the path, and training views to compare with.
constexpr int kMaxChecks = 90, kMaxReferences = 32;
// A look may be this much worse than nearly all training views: a few pixels, which differ by chance.
constexpr double kSlack = 0.03, kReferenceShare = 0.9;
// How far poses are drawn to the cameras, tried in this order; the rounds that find the nearest cluster.
constexpr std::array<double, 4> kPulls = {0.25, 0.5, 0.75, 1};
constexpr int kClusterRounds = 3;
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
        near_(static_cast<float>(kFreeShare * depth)) {}

  struct Look {
    double near = 0, unobserved = 0;  // shares of the picture
  };

  Look From(const io::Rigid3d& pose) const {
    RenderOptions options{.threads = threads_, .step_scale = 1, .samples_per_pixel = 1, .splats = false};
    const RenderedView whole = field_.Render(camera_, pose, options);
    options.limits.end = near_;
    const RenderedView close = field_.Render(camera_, pose, options);
    Look look;
    for (const float opacity : close.opacity)
      look.near += static_cast<double>(opacity) / static_cast<double>(close.opacity.size());
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
    near_ = io::Quantile(near, kReferenceShare) + kSlack;
    unobserved_ = io::Quantile(unobserved, kReferenceShare) + kSlack;
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

// Pulls per pose, from those at the checked ones: as strong as any near it, and without steps.
std::vector<double> Spread(const std::vector<double>& checked, int stride, int frames, bool loop) {
  const int reach = std::max(stride, static_cast<int>(std::lround(kPullShare * frames)));
  const auto index = [&](int i) {
    return loop ? (i % frames + frames) % frames : std::clamp(i, 0, frames - 1);
  };
  std::vector<double> strongest(static_cast<std::size_t>(frames)), spread(static_cast<std::size_t>(frames));
  for (std::size_t k = 0; k < checked.size(); ++k) {
    const int middle = static_cast<int>(k) * stride;
    for (int i = middle - 2 * reach; i <= middle + 2 * reach; ++i) {
      double& at = strongest[static_cast<std::size_t>(index(i))];
      at = std::max(at, checked[k]);
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

}  // namespace

FreePathReport KeepFree(const TrainedField& field,
                        const io::Scene& train,
                        const SupportMap& support,
                        int threads,
                        CameraPath* path) {
  const Scout scout(field, train, support, path->capture.depth, threads);
  const Standard standard(scout, train);
  const std::vector<io::Rigid3d> cameras = PosesOf(train);
  std::vector<io::Rigid3d>& poses = path->world_from_cam;
  const int frames = static_cast<int>(poses.size()), stride = (frames + kMaxChecks - 1) / kMaxChecks;
  FreePathReport report;
  std::vector<double> pulls;
  for (int i = 0; i < frames; i += stride) {
    const io::Rigid3d& pose = poses[static_cast<std::size_t>(i)];
    double least = standard.Excess(scout.From(pose)), pull = 0;
    ++report.checked;
    if (least > 0) {
      ++report.obstructed;
      const io::Rigid3d cluster = NearestCluster(cameras, path->capture, pose);
      for (const double share : kPulls) {
        const double excess = standard.Excess(scout.From(Between(pose, cluster, share)));
        if (excess < least) least = excess, pull = share;
        if (least <= 0) break;
      }
    }
    pulls.push_back(pull);
  }
  if (report.obstructed == 0) return report;
  const std::vector<double> spread = Spread(pulls, stride, frames, path->IsLoop());
  for (int i = 0; i < frames; ++i) {
    io::Rigid3d& pose = poses[static_cast<std::size_t>(i)];
    const double pull = spread[static_cast<std::size_t>(i)];
    if (pull > 0) pose = Between(pose, NearestCluster(cameras, path->capture, pose), pull);
    if (i % stride == 0) report.remaining += standard.Excess(scout.From(pose)) > 0;
  }
  return report;
}

}  // namespace nerf
