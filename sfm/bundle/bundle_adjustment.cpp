#include "sfm/bundle/bundle_adjustment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "sfm/bundle/bundle_state.h"

namespace sfm {
namespace {

// Up to here the dense factorisation of the reduced camera system is faster than conjugate gradients:
// pictures that surround a subject nearly all share points. Its cost grows with their cube.
constexpr std::size_t kMaxDenseFrames = 200;
// Residual, over the right-hand side, at which conjugate gradients end. On 300 pictures the iterations are as
// many, and as good, as with the factorisation.
constexpr double kLinearResidual = 1e-2;
constexpr int kLinearIterations = 1000;

void CheckObservations(const io::ColmapModel& model) {
  for (const io::Observation& observation : model.observations) {
    const io::Frame& frame = model.scene.frames[static_cast<std::size_t>(observation.frame_index)];
    const Eigen::Vector3d& xyz = model.scene.points[static_cast<std::size_t>(observation.point_index)].xyz;
    const std::string name = frame.image_path.string();
    if (!observation.xy.allFinite() || !xyz.allFinite()) {
      throw io::Error(
          io::ExitCode::kNumeric,
          fmt::format("{}: an observation of point {} is not finite", name, observation.point_index),
          "Reconstruct the capture again");
    }
    if (!((frame.world_from_cam.Inverse() * xyz).z() < 0)) {
      throw io::Error(io::ExitCode::kNumeric,
                      fmt::format("{}: point {} is observed but does not lie in front of the camera",
                                  name,
                                  observation.point_index),
                      "Reconstruct the capture again");
    }
  }
}

// Shows how far the solver has come, and stops it at an interrupt.
class Watch : public ceres::IterationCallback {
 public:
  explicit Watch(const AdjustmentOptions& options) : max_iterations_(options.max_iterations) {
    if (!options.title.empty()) progress_.emplace(options.title);
  }

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (progress_) {
      progress_->Update(std::min(0.99, static_cast<double>(summary.iteration) / max_iterations_),
                        fmt::format("iteration {}, at most {}", summary.iteration, max_iterations_));
    }
    return io::PendingInterrupt() == 0 ? ceres::SOLVER_CONTINUE : ceres::SOLVER_ABORT;
  }

  void Finish() {
    if (progress_) progress_->Update(1);
  }

 private:
  const int max_iterations_;
  std::optional<io::Progress> progress_;
};

class Solver {
 public:
  Solver(const io::ColmapModel& model,
         const std::vector<FreeIntrinsics>& free,
         const std::vector<std::size_t>& moves_with)
      : model_(model),
        state_(ToBundleState(model.scene)),
        loss_(kRobustScalePx),
        problem_(ceres::Problem::Options{.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP}),
        lens_owners_(LensOwners(free)),
        moves_with_(moves_with.empty() ? MovingAlone(model.scene.frames.size()) : moves_with) {
    AddObservations();
    FixGauge();
    HoldIntrinsics(free);
  }

  const BundleState& state() const { return state_; }

  AdjustmentReport Solve(const AdjustmentOptions& options) {
    ceres::Solver::Options ceres_options;
    if (model_.scene.frames.size() <= kMaxDenseFrames) {
      ceres_options.linear_solver_type = ceres::DENSE_SCHUR;
    } else {
      ceres_options.linear_solver_type = ceres::ITERATIVE_SCHUR;
      ceres_options.preconditioner_type = ceres::SCHUR_JACOBI;
      ceres_options.use_explicit_schur_complement = true;
      ceres_options.eta = kLinearResidual;
      ceres_options.max_linear_solver_iterations = kLinearIterations;
    }
    ceres_options.linear_solver_ordering = PointsFirst();
    ceres_options.num_threads = 1;
    ceres_options.max_num_iterations = options.max_iterations;
    ceres_options.function_tolerance = options.function_tolerance;
    ceres_options.gradient_tolerance = ceres_options.parameter_tolerance = 0;  // neither is free of units
    ceres_options.logging_type = ceres::SILENT;
    Watch watch(options);
    ceres_options.callbacks = {&watch};
    ceres::Solver::Summary summary;
    {
      const io::PromptStop stop;  // an iteration with a thousand pictures takes many seconds
      ceres::Solve(ceres_options, &problem_, &summary);
    }
    io::ThrowIfInterrupted();
    watch.Finish();
    for (std::size_t i = 0; i < lens_owners_.size(); ++i) {
      state_.intrinsics[i].tail<kLensIntrinsics>() =
          state_.intrinsics[lens_owners_[i]].tail<kLensIntrinsics>();
    }
    for (std::size_t i = 0; i < moves_with_.size(); ++i) {
      if (moves_with_[i] == i) continue;
      const PoseVector& leader = state_.poses[moves_with_[i]];
      state_.poses[i] << RotationFromLeader(state_, moves_with_[i], i) * leader.head<3>(), leader.tail<3>();
    }
    if (!summary.IsSolutionUsable() || !std::isfinite(summary.final_cost)) {
      throw io::Error(io::ExitCode::kNumeric,
                      "bundle adjustment failed: " + summary.message,
                      "Reconstruct the capture again");
    }
    return {.initial_cost = summary.initial_cost,
            .final_cost = summary.final_cost,
            .iterations = static_cast<int>(summary.iterations.size()) - 1,
            .converged = summary.termination_type == ceres::CONVERGENCE};
  }

 private:
  void AddObservations() {
    for (const io::Observation& observation : model_.observations) {
      const auto frame = static_cast<std::size_t>(observation.frame_index);
      const auto camera = static_cast<std::size_t>(model_.scene.frames[frame].camera_index);
      problem_.AddResidualBlock(new ReprojectionCost(observation.xy,
                                                     observation.sigma,
                                                     state_.reference_rotations[moves_with_[frame]],
                                                     RotationFromLeader(state_, moves_with_[frame], frame)),
                                &loss_,
                                state_.poses[moves_with_[frame]].data(),
                                state_.points[static_cast<std::size_t>(observation.point_index)].data(),
                                state_.intrinsics[camera].data(),
                                state_.intrinsics[lens_owners_[camera]].data() + 1);
    }
  }

  // The farthest pair makes the length that is kept as insensitive to noise as possible.
  void FixGauge() {
    std::vector<PoseVector*> seen;
    for (PoseVector& pose : state_.poses) {
      if (problem_.HasParameterBlock(pose.data())) seen.push_back(&pose);
    }
    PoseVector *first = nullptr, *second = nullptr;
    Eigen::Vector3d baseline = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < seen.size(); ++i) {
      for (std::size_t j = i + 1; j < seen.size(); ++j) {
        const Eigen::Vector3d difference = seen[j]->tail<3>() - seen[i]->tail<3>();
        if (difference.norm() > baseline.norm()) first = seen[i], second = seen[j], baseline = difference;
      }
    }
    if (!first) {
      throw io::Error(io::ExitCode::kNumeric,
                      "fewer than two pictures at different places have observations",
                      "Bundle adjustment needs pictures from different places");
    }
    int coordinate;
    baseline.cwiseAbs().maxCoeff(&coordinate);
    problem_.SetParameterBlockConstant(first->data());
    problem_.SetManifold(second->data(), new ceres::SubsetManifold(6, {3 + coordinate}));
  }

  void HoldIntrinsics(const std::vector<FreeIntrinsics>& free) {
    for (std::size_t i = 0; i < state_.intrinsics.size(); ++i) {
      double *const focal = state_.intrinsics[i].data(), *const lens = focal + 1;
      if (problem_.HasParameterBlock(focal) && !free[i].focal) problem_.SetParameterBlockConstant(focal);
      if (!problem_.HasParameterBlock(lens)) continue;
      const std::vector<int> free_indices = FreeIndices(free[i]);
      std::vector<int> held;
      for (int k = 1; k < kIntrinsics; ++k) {
        if (!std::binary_search(free_indices.begin(), free_indices.end(), k)) held.push_back(k - 1);
      }
      if (held.size() == kLensIntrinsics) {
        problem_.SetParameterBlockConstant(lens);
      } else if (!held.empty()) {
        problem_.SetManifold(lens, new ceres::SubsetManifold(kLensIntrinsics, held));
      }
    }
  }

  std::shared_ptr<ceres::ParameterBlockOrdering> PointsFirst() {
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    const auto add = [&](double* block, int group) {
      if (problem_.HasParameterBlock(block)) ordering->AddElementToGroup(block, group);
    };
    for (Eigen::Vector3d& point : state_.points) add(point.data(), 0);
    for (PoseVector& pose : state_.poses) add(pose.data(), 1);
    // A group of their own: within a group Ceres orders blocks by address, and so by what else the heap
    // holds.
    for (IntrinsicVector& intrinsics : state_.intrinsics) {
      add(intrinsics.data(), 2);
      add(intrinsics.data() + 1, 2);
    }
    return ordering;
  }

  const io::ColmapModel& model_;
  BundleState state_;
  ceres::CauchyLoss loss_;
  ceres::Problem problem_;
  std::vector<std::size_t> lens_owners_, moves_with_;
};

}  // namespace

AdjustmentReport AdjustBundle(io::ColmapModel* model, const AdjustmentOptions& options) {
  CheckObservations(*model);
  Solver solver(*model, options.free, options.moves_with);
  const AdjustmentReport report = solver.Solve(options);
  UpdateScene(solver.state(), &model->scene);
  return report;
}

}  // namespace sfm
