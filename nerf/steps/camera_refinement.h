// Poses of the training views, refined by the loss of their own rays where these ask for it.
//
// A view's pose moves by x = (c, w) in its camera's coordinates: position += R c, R <- R exp(w). The same
// length of x does very different things to a picture, so x = C^-1/2 z with C = mean J^T J + damping over the
// view's sparse points, J = d pixel / d x: a unit of z moves the picture by about a pixel [Park et al. 2023,
// CamP].
//
// Each step gives every view a noisy gradient g of the loss over z. At a right pose its mean is zero. The
// steps are cut into windows, each at least a quarter as long as the run so far, and after each one a view's
// mean is compared with its noise,
//   t^2 = mean over the six parameters of 100 mean(g)^2 / var(g),
// at most about 1 where the mean is zero. It counts 100 steps, those of the shortest window, also in longer
// ones, so that long runs do not move views for pulls that hardly show.
// A view moves, by Adam, during the windows that follow kMovingWindows in a row with t > kMovingT. So poses
// that are right to what the pictures can tell stay as they are, bit for bit, and those that are not move
// until nothing pulls any more.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "nerf/data/dataset.h"
#include "nerf/sampling/pose_motion.h"
#include "nerf/sampling/scene_contraction.h"
#include "nerf/steps/shard_samples.h"

namespace nerf {

// d loss / d unit of a shard's sorted samples [n] along each axis, unit being the position in the unit cube.
using UnitGradients = std::array<std::vector<float>, 3>;

class CameraRefinement {
 public:
  // Right poses of real captures have a larger t in about one of 300 windows, too often for hundreds of
  // views: each would be moved by noise, by up to a pixel. Two windows in a row have it in one of 10^5.
  static constexpr double kMovingT = 2;
  static constexpr float kMovingWindows = 2;

  // The views of `dataset` are the frames of `scene`, and move; both must outlive the refinement. state: of
  // earlier steps, or empty.
  CameraRefinement(const io::Scene& scene,
                   const SceneContraction& contraction,
                   double pixel_offset,
                   Dataset* dataset,
                   std::vector<float>* state);

  // Whether a shard of a step is looked at: every fourth.
  static bool LooksAt(int shard, std::uint64_t step) {
    return (static_cast<std::uint64_t>(shard) + step) % 4 == 0;
  }
  // Sets gradients [n_views] to d loss / d (c, w) over the rays of a shard.
  void Differentiate(const RayBatch& batch,
                     const ShardSamples& samples,
                     const UnitGradients& unit_gradients,
                     std::vector<Vector6d>* gradients) const;
  // Takes the sum of a step's gradients. n_steps: of the run so far. learning_rate: pixels.
  void Step(std::uint64_t n_steps, double learning_rate, const std::vector<Vector6d>& gradients);

  // Of each view, by how many pixels it has moved.
  std::vector<double> Motions() const;
  // The frames of `scene` as they are now.
  std::vector<io::Rigid3d> WorldFromCam() const;

 private:
  // Rows of six values per view in the state.
  enum Row : std::size_t { kMotion, kMean, kSquare, kSum, kSquares, kRows };
  static constexpr std::size_t kValues = 6 * kRows + 3;  // and those below

  Eigen::Map<Eigen::Matrix<float, 6, 1>> Values(std::size_t view, Row row) const {
    return Eigen::Map<Eigen::Matrix<float, 6, 1>>(&(*state_)[view * kValues + 6 * row]);
  }
  float& AdamSteps(std::size_t view) const { return (*state_)[view * kValues + 6 * kRows]; }
  // The last windows in a row that had t > kMovingT, as far as they count.
  float& PulledWindows(std::size_t view) const { return (*state_)[view * kValues + 6 * kRows + 1]; }
  float& WindowSteps(std::size_t view) const { return (*state_)[view * kValues + 6 * kRows + 2]; }

  const io::Camera& CameraOf(std::size_t view) const;
  io::Rigid3d Moved(std::size_t view) const;
  void Move(std::size_t view, double learning_rate, const Vector6d& gradient);
  void EndWindow(std::size_t view);

  const io::Scene& scene_;
  const SceneContraction& contraction_;
  const double pixel_offset_;
  Dataset* dataset_;
  std::vector<float>* state_;
  std::vector<Matrix6d> preconditioners_;  // C^-1/2
};

}  // namespace nerf
