#include "sfm/bundle/point_adjustment.h"

#include <atomic>

#include "io/process/parallel.h"
#include "io/scene/decomposition.h"
#include "sfm/bundle/bundle_state.h"

namespace sfm {
namespace {

constexpr int kPointIterations = 10;
// Of the squared length of a step, over that of the point's position plus one, in units of the cameras'
// spread: below, rounding moves the point as much.
constexpr double kSmallestStep = 1e-20;
// Damping of the first step, and what a step that worked or failed changes it by.
constexpr double kDamping = 1e-4, kEasier = 0.1, kHarder = 10;
constexpr std::size_t kPointsPerTask = 256;

using Observers = std::vector<const io::Observation*>;

class PointProblem {
 public:
  PointProblem(const io::Scene& scene, const BundleState& state, const Observers& track)
      : scene_(scene), state_(state), track_(track) {}

  double Cost(const Eigen::Vector3d& point) const { return Evaluate(point, nullptr, nullptr); }

  // Returns the cost; its Gauss-Newton matrix and gradient where asked for.
  double Evaluate(const Eigen::Vector3d& point, Eigen::Matrix3d* matrix, Eigen::Vector3d* gradient) const {
    double cost = 0;
    if (matrix) matrix->setZero(), gradient->setZero();
    for (const io::Observation* o : track_) {
      const auto frame = static_cast<std::size_t>(o->frame_index);
      const auto camera = static_cast<std::size_t>(scene_.frames[frame].camera_index);
      const double* const intrinsics = state_.intrinsics[camera].data();
      const double* parameters[] = {state_.poses[frame].data(), point.data(), intrinsics, intrinsics + 1};
      Eigen::Vector2d residual;
      Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point;
      double* jacobians[] = {nullptr, d_point.data(), nullptr, nullptr};
      ReprojectionCost(o->xy, o->sigma, state_.reference_rotations[frame])
          .Evaluate(parameters, residual.data(), matrix ? jacobians : nullptr);
      cost += RobustLoss(residual.squaredNorm());
      if (!matrix) continue;
      const double weight = RobustWeight(residual.squaredNorm());
      *matrix += weight * d_point.transpose() * d_point;
      *gradient += weight * d_point.transpose() * residual;
    }
    return cost;
  }

 private:
  const io::Scene& scene_;
  const BundleState& state_;
  const Observers& track_;
};

Eigen::Vector3d Minimise(const PointProblem& problem, Eigen::Vector3d point) {
  double damping = kDamping;
  Eigen::Matrix3d matrix;
  Eigen::Vector3d gradient;
  double cost = problem.Evaluate(point, &matrix, &gradient);
  for (int i = 0; i < kPointIterations; ++i) {
    Eigen::Matrix3d damped = matrix;
    damped.diagonal() *= 1 + damping;
    const Eigen::Vector3d step = io::SolveSymmetric(damped, -gradient);
    if (!step.allFinite() || step.squaredNorm() < kSmallestStep * (1 + point.squaredNorm())) break;
    if (problem.Cost(point + step) < cost) {
      point += step;
      cost = problem.Evaluate(point, &matrix, &gradient);
      damping *= kEasier;
    } else {
      damping *= kHarder;
    }
  }
  return point;
}

bool IsInFront(const io::Scene& scene, const Observers& track) {
  for (const io::Observation* o : track) {
    if (!io::Project(scene, *o)) return false;
  }
  return true;
}

}  // namespace

bool AdjustPoints(io::ColmapModel* model, int threads) {
  BundleState state = ToBundleState(model->scene);
  std::vector<Observers> tracks(model->scene.points.size());
  for (const io::Observation& o : model->observations)
    tracks[static_cast<std::size_t>(o.point_index)].push_back(&o);
  const auto for_each_point = [&](const auto& work) {
    io::ParallelFor((tracks.size() + kPointsPerTask - 1) / kPointsPerTask, threads, [&](std::size_t task) {
      const std::size_t end = std::min(tracks.size(), (task + 1) * kPointsPerTask);
      for (std::size_t i = task * kPointsPerTask; i < end; ++i) work(i);
    });
  };
  for_each_point([&](std::size_t i) {
    state.points[i] = Minimise(PointProblem(model->scene, state, tracks[i]), state.points[i]);
  });
  const std::vector<io::Frame> frames = model->scene.frames;
  const std::vector<io::Camera> cameras = model->scene.cameras;
  UpdateScene(state, &model->scene);
  // What was not moved keeps its bits.
  model->scene.frames = frames;
  model->scene.cameras = cameras;
  std::atomic<bool> in_front = true;
  for_each_point([&](std::size_t i) {
    if (!IsInFront(model->scene, tracks[i])) in_front = false;
  });
  return in_front;
}

}  // namespace sfm
