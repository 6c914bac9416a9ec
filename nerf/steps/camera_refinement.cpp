#include "nerf/steps/camera_refinement.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "io/base/check.h"
#include "io/base/error.h"

namespace nerf {
namespace {

// Of C, relative to its largest eigenvalue: directions that move the picture less are not moved farther by
// it.
constexpr double kDamping = 1e-3;
// Fewer sparse points than this do not stand for a picture.
constexpr std::size_t kMinPoints = 10;
// Steps of the shortest window: enough for a mean and its noise.
constexpr double kMinWindow = 100, kWindowShare = 0.25;
constexpr double kBeta1 = 0.9, kBeta2 = 0.99;  // of Adam
// Added to variances: far below those of any gradient.
constexpr double kTinyVariance = 1e-30;

// Of points on a lattice over the picture, for views without sparse points.
Matrix6d MeanSquareOfLattice(const io::Camera& camera, double distance) {
  constexpr int kSide = 5;
  Matrix6d sum = Matrix6d::Zero();
  for (int i = 0; i < kSide * kSide; ++i) {
    const double x = (i % kSide + 0.5) / kSide * camera.width, y = (i / kSide + 0.5) / kSide * camera.height;
    const PixelJacobian j = PixelOfMotion(camera, PointInCamera(camera, x, y, distance));
    sum += j.transpose() * j;
  }
  return sum / (kSide * kSide);
}

Matrix6d InverseRoot(const Matrix6d& c) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(c);
  const Vector6d values = eigen.eigenvalues().array() + kDamping * eigen.eigenvalues().maxCoeff();
  return eigen.eigenvectors() * values.cwiseSqrt().cwiseInverse().asDiagonal() *
         eigen.eigenvectors().transpose();
}

}  // namespace

CameraRefinement::CameraRefinement(const io::Scene& scene,
                                   const SceneContraction& contraction,
                                   double pixel_offset,
                                   Dataset* dataset,
                                   std::vector<float>* state)
    : scene_(scene),
      contraction_(contraction),
      pixel_offset_(pixel_offset),
      dataset_(dataset),
      state_(state) {
  const std::size_t n = scene.frames.size();
  PIPELINE_CHECK_EQ(n, dataset->views.size());
  if (state_->empty()) state_->assign(n * kValues, 0.f);
  if (state_->size() != n * kValues) {
    throw io::Error(io::ExitCode::kBadState,
                    fmt::format("checkpoint.bin: has cameras of another scene, not of {} views", n),
                    "Delete it and train again");
  }
  std::vector<Matrix6d> sums(n, Matrix6d::Zero());
  std::vector<std::size_t> counts(n, 0);
  for (const SparseDepth& depth : dataset->depths) {
    const io::Camera& camera = CameraOf(depth.view);
    const PixelJacobian j = PixelOfMotion(camera, PointInCamera(camera, depth.x, depth.y, depth.t));
    sums[depth.view] += j.transpose() * j;
    ++counts[depth.view];
  }
  const Eigen::Vector3d centre(contraction.centre[0], contraction.centre[1], contraction.centre[2]);
  for (std::size_t v = 0; v < n; ++v) {
    const double distance =
        std::max<double>((scene.frames[v].world_from_cam.translation - centre).norm(), contraction.half);
    preconditioners_.push_back(InverseRoot(counts[v] >= kMinPoints
                                               ? Matrix6d(sums[v] / static_cast<double>(counts[v]))
                                               : MeanSquareOfLattice(CameraOf(v), distance)));
    dataset_->views[v].camera = RayCamera(CameraOf(v), Moved(v), pixel_offset_);
  }
}

const io::Camera& CameraRefinement::CameraOf(std::size_t view) const {
  return scene_.cameras[static_cast<std::size_t>(scene_.frames[view].camera_index)];
}

io::Rigid3d CameraRefinement::Moved(std::size_t view) const {
  return MovedPose(scene_.frames[view].world_from_cam,
                   preconditioners_[view] * Values(view, kMotion).cast<double>());
}

void CameraRefinement::Differentiate(const RayBatch& batch,
                                     const ShardSamples& samples,
                                     const UnitGradients& unit_gradients,
                                     std::vector<Vector6d>* gradients) const {
  gradients->assign(dataset_->views.size(), Vector6d::Zero());
  for (std::size_t r = 0; r < batch.rays.size(); ++r) {
    const BatchRay& batch_ray = batch.rays[r];
    const Ray& ray = batch_ray.ray;
    Eigen::Vector3d d_origin = Eigen::Vector3d::Zero(), d_direction = Eigen::Vector3d::Zero();
    const int index = static_cast<int>(r);
    for (std::size_t i = samples.First(index); i < samples.First(index + 1); ++i) {
      const float t = samples.sorted.t[i];
      const float d_unit[3] = {unit_gradients[0][i], unit_gradients[1][i], unit_gradients[2][i]};
      Eigen::Vector3f d_x;
      if (std::isinf(t)) {
        SceneContraction::PullBackAtInfinity(ray.direction, d_unit, d_x.data());
        d_direction += d_x.cast<double>();
      } else {
        float x[3];
        for (int j = 0; j < 3; ++j) x[j] = ray.origin[j] + t * ray.direction[j];
        contraction_.PullBack(x, d_unit, d_x.data());
        d_origin += d_x.cast<double>();
        d_direction += static_cast<double>(t) * d_x.cast<double>();
      }
    }
    // Of the unmoved rotation: the motion is counted from there, and small.
    const Eigen::Matrix3d to_cam = scene_.frames[batch_ray.view].world_from_cam.rotation.transpose();
    const Eigen::Vector3d direction =
        to_cam * Eigen::Vector3d(ray.direction[0], ray.direction[1], ray.direction[2]);
    Vector6d& sum = (*gradients)[batch_ray.view];
    sum.head<3>() += to_cam * d_origin;
    sum.tail<3>() += direction.cross(to_cam * d_direction);
  }
}

void CameraRefinement::Move(std::size_t view, double learning_rate, const Vector6d& gradient) {
  auto mean = Values(view, kMean), square = Values(view, kSquare);
  const double n = ++AdamSteps(view);
  mean = (kBeta1 * mean.cast<double>() + (1 - kBeta1) * gradient).cast<float>();
  square = (kBeta2 * square.cast<double>() + (1 - kBeta2) * gradient.cwiseAbs2()).cast<float>();
  const Vector6d m = mean.cast<double>() / (1 - std::pow(kBeta1, n)),
                 v = square.cast<double>() / (1 - std::pow(kBeta2, n));
  const Vector6d step = learning_rate * (m.array() / (v.array() + kTinyVariance).sqrt()).matrix();
  Values(view, kMotion) -= step.cast<float>();
  dataset_->views[view].camera = RayCamera(CameraOf(view), Moved(view), pixel_offset_);
}

void CameraRefinement::EndWindow(std::size_t view) {
  auto sum = Values(view, kSum), squares = Values(view, kSquares);
  const double n = WindowSteps(view);
  const Vector6d mean = sum.cast<double>() / n, variance = squares.cast<double>() / n - mean.cwiseAbs2();
  const double t2 = (kMinWindow * mean.cwiseAbs2().array() / (variance.array() + kTinyVariance)).mean();
  PulledWindows(view) = t2 > kMovingT * kMovingT ? std::min(PulledWindows(view) + 1, kMovingWindows) : 0.f;
  sum.setZero(), squares.setZero();
  WindowSteps(view) = 0;
}

void CameraRefinement::Step(std::uint64_t n_steps,
                            double learning_rate,
                            const std::vector<Vector6d>& gradients) {
  PIPELINE_CHECK_EQ(gradients.size(), preconditioners_.size());
  for (std::size_t v = 0; v < gradients.size(); ++v) {
    const Vector6d gradient = preconditioners_[v] * gradients[v];
    Values(v, kSum) += gradient.cast<float>();
    Values(v, kSquares) += gradient.cwiseAbs2().cast<float>();
    if (PulledWindows(v) >= kMovingWindows) Move(v, learning_rate, gradient);
    if (++WindowSteps(v) >= std::max(kMinWindow, kWindowShare * static_cast<double>(n_steps))) EndWindow(v);
  }
}

std::vector<double> CameraRefinement::Motions() const {
  std::vector<double> motions;
  for (std::size_t v = 0; v < preconditioners_.size(); ++v) motions.push_back(Values(v, kMotion).norm());
  return motions;
}

std::vector<io::Rigid3d> CameraRefinement::WorldFromCam() const {
  std::vector<io::Rigid3d> poses;
  for (std::size_t v = 0; v < preconditioners_.size(); ++v) poses.push_back(Moved(v));
  return poses;
}

}  // namespace nerf
