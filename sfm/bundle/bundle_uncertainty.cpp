#include "sfm/bundle/bundle_uncertainty.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "io/process/interrupt.h"
#include "io/scene/decomposition.h"
#include "sfm/bundle/bundle_state.h"

namespace sfm {
namespace {

// Added to the diagonal of the reduced system after it has been scaled to ones: above the rounding of the
// factorisation, so that it succeeds, and far below what any determined parameter has. An undetermined one
// gets a sigma up to 3e6 times what it would be if all others were known.
constexpr double kRidge = 1e-13;
// Eigenvalues of a point's block below this share of the largest are rounding: seen once, or at infinity.
constexpr double kPointRank = 1e-12;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Rows of one frame in the reduced system, and their product with a point.
struct PoseBlock {
  Eigen::Index offset;
  Eigen::Matrix<double, 6, 3> with_point;
};

// The same of the focal length or lens of a camera, over all frames that it took.
struct CameraBlock {
  Eigen::Index offset;
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kLensIntrinsics, 3> with_point;
};

void AddTo(std::vector<CameraBlock>* blocks, const CameraBlock& added) {
  for (CameraBlock& block : *blocks) {
    if (block.offset != added.offset || block.with_point.rows() != added.with_point.rows()) continue;
    block.with_point += added.with_point;
    return;
  }
  blocks->push_back(added);
}

class ReducedSystem {
 public:
  ReducedSystem(const io::ColmapModel& model,
                const std::vector<FreeIntrinsics>& free,
                const std::vector<std::size_t>& moves_with)
      : model_(model),
        free_(free),
        state_(ToBundleState(model.scene)),
        lens_owners_(LensOwners(free)),
        moves_with_(moves_with) {
    AssignRows();
    matrix_ = Eigen::MatrixXd::Zero(size_, size_);
    std::vector<std::vector<const io::Observation*>> tracks(state_.points.size());
    for (const io::Observation& observation : model.observations) {
      tracks[static_cast<std::size_t>(observation.point_index)].push_back(&observation);
    }
    for (const auto& track : tracks) {
      if (!track.empty()) AddPoint(track);
    }
    sigma0_ = Sigma0(tracks);
    Factorise();
  }

  BundleUncertainty Solve(bool with_poses) const {
    const Eigen::Index first = with_poses ? 0 : n_pose_rows_;
    const Eigen::VectorXd variances = Variances(first);
    BundleUncertainty result{.sigma0_px = sigma0_};
    for (std::size_t i = 0; i < focal_rows_.size(); ++i) {
      IntrinsicVector sigma = IntrinsicVector::Zero();
      const auto at = [&](Eigen::Index row) {
        return focal_rows_[i] < 0 ? kInfinity : std::sqrt(variances[row - first]);
      };
      if (free_[i].focal) sigma[kFocal] = at(focal_rows_[i]);
      const std::vector<int>& lens = lens_indices_[lens_owners_[i]];
      for (std::size_t k = 0; k < lens.size(); ++k) {
        sigma[lens[k] + 1] = at(lens_rows_[lens_owners_[i]] + static_cast<Eigen::Index>(k));
      }
      result.intrinsics.push_back(sigma);
    }
    if (with_poses) result.poses = Poses(variances);
    return result;
  }

 private:
  // Observed frames first, then the free intrinsics of observed cameras; -1 for the others.
  void AssignRows() {
    frame_rows_.assign(state_.poses.size(), -1);
    focal_rows_.assign(state_.intrinsics.size(), -1);
    lens_rows_ = focal_rows_;
    for (const io::Observation& observation : model_.observations) {
      const auto frame = static_cast<std::size_t>(observation.frame_index);
      const auto camera = static_cast<std::size_t>(model_.scene.frames[frame].camera_index);
      frame_rows_[moves_with_[frame]] = focal_rows_[camera] = lens_rows_[lens_owners_[camera]] = 0;
    }
    for (std::size_t i = 0; i < frame_rows_.size(); ++i) {
      if (moves_with_[i] != i || frame_rows_[i] < 0) continue;
      frame_rows_[i] = size_;
      size_ += 6;
    }
    for (std::size_t i = 0; i < frame_rows_.size(); ++i) frame_rows_[i] = frame_rows_[moves_with_[i]];
    n_pose_rows_ = size_;
    for (std::size_t i = 0; i < focal_rows_.size(); ++i) {
      if (focal_rows_[i] >= 0) {
        focal_rows_[i] = size_;
        size_ += free_[i].focal;
      }
      lens_indices_.emplace_back();
      for (const int k : FreeIndices(free_[i])) {
        if (k != kFocal) lens_indices_[i].push_back(k - 1);
      }
      if (lens_rows_[i] < 0) continue;
      lens_rows_[i] = size_;
      size_ += static_cast<Eigen::Index>(lens_indices_[i].size());
    }
  }

  // Adds the share of one point, which is eliminated at once. Only the lower triangle is filled.
  void AddPoint(const std::vector<const io::Observation*>& track) {
    Eigen::Matrix3d point_block = Eigen::Matrix3d::Zero();
    std::vector<PoseBlock> poses;
    std::vector<CameraBlock> cameras;
    for (const io::Observation* observation : track) {
      const auto frame = static_cast<std::size_t>(observation->frame_index);
      const auto point = static_cast<std::size_t>(observation->point_index);
      const auto camera = static_cast<std::size_t>(model_.scene.frames[frame].camera_index);
      const std::size_t lens = lens_owners_[camera];
      Eigen::Vector2d residual;
      Eigen::Matrix<double, 2, 6, Eigen::RowMajor> d_pose;
      Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point;
      Eigen::Matrix<double, 2, 1> d_focal;
      Eigen::Matrix<double, 2, kLensIntrinsics, Eigen::RowMajor> d_lens;
      const std::size_t leader = moves_with_[frame];
      const double* parameters[] = {state_.poses[leader].data(),
                                    state_.points[point].data(),
                                    state_.intrinsics[camera].data(),
                                    state_.intrinsics[lens].data() + 1};
      double* jacobians[] = {d_pose.data(), d_point.data(), d_focal.data(), d_lens.data()};
      ReprojectionCost(observation->xy,
                       observation->sigma,
                       state_.reference_rotations[leader],
                       RotationFromLeader(state_, leader, frame))
          .Evaluate(parameters, residual.data(), jacobians);
      const double s = residual.squaredNorm(), w = RobustWeight(s);
      const double across = w, along = w - 2 * s * w * w / (kRobustScalePx * kRobustScalePx);
      sum_w_ += w, sum_w2_s_ += w * w * s;
      sum_slope_ += (across + along) / 2, sum_slope2_ += (across * across + along * along) / 2;

      using Columns = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kLensIntrinsics>;
      const std::pair<Eigen::Index, Columns> parts[] = {
          {frame_rows_[frame], d_pose},
          {focal_rows_[camera], d_focal.leftCols(free_[camera].focal)},
          {lens_rows_[lens], d_lens(Eigen::all, lens_indices_[lens])}};
      for (const auto& [row, d_row] : parts) {
        for (const auto& [column, d_column] : parts) {
          if (column > row) continue;
          matrix_.block(row, column, d_row.cols(), d_column.cols()) += w * d_row.transpose() * d_column;
        }
      }
      poses.push_back({parts[0].first, w * d_pose.transpose() * d_point});
      for (const auto& [row, d_row] : {parts[1], parts[2]}) {
        if (d_row.cols() > 0) AddTo(&cameras, {row, w * d_row.transpose() * d_point});
      }
      point_block += w * d_point.transpose() * d_point;
    }
    // V^-1 = G G^T without the directions in which the observations do not determine the point: there W is 0.
    const auto [values, vectors] = io::EigenDecomposition(point_block);
    Eigen::Matrix3d root = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 3; ++i) {
      if (values[i] > kPointRank * values[2]) root.col(i) = vectors.col(i) / std::sqrt(values[i]);
    }
    for (PoseBlock& pose : poses) pose.with_point *= root;
    for (CameraBlock& camera : cameras) camera.with_point *= root;
    for (const PoseBlock& a : poses) {
      for (const PoseBlock& b : poses) {
        if (b.offset > a.offset) continue;
        matrix_.block<6, 6>(a.offset, b.offset).noalias() -= a.with_point * b.with_point.transpose();
      }
    }
    for (const CameraBlock& a : cameras) {  // below the rows of all poses
      const Eigen::Index rows = a.with_point.rows();
      for (const PoseBlock& b : poses)
        matrix_.block(a.offset, b.offset, rows, 6).noalias() -= a.with_point * b.with_point.transpose();
      for (const CameraBlock& b : cameras) {
        if (b.offset > a.offset) continue;
        matrix_.block(a.offset, b.offset, rows, b.with_point.rows()).noalias() -=
            a.with_point * b.with_point.transpose();
      }
    }
  }

  double Sigma0(const std::vector<std::vector<const io::Observation*>>& tracks) const {
    const double n = static_cast<double>(model_.observations.size());
    double parameters = static_cast<double>(size_ - 7);
    for (const auto& track : tracks) parameters += track.empty() ? 0 : 3;
    const double redundancy = std::max(1.0, 2 * n - parameters);
    const double mean_slope = sum_slope_ / n, variance = sum_slope2_ / n - mean_slope * mean_slope;
    const double correction = 1 + parameters / (2 * n) * variance / (mean_slope * mean_slope);
    return correction * std::sqrt(sum_w2_s_ / redundancy * sum_w_ / n) / mean_slope;
  }

  // An orthonormal basis of what a similarity of the world does to the poses: with x_cam = exp([w]x) R (X -
  // C), a translation d: dC = d; a turn about the axis a: dC = a x C, dw = -R a; the scale: dC = C.
  void FindNullSpace() {
    Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(size_, 7);
    for (std::size_t i = 0; i < frame_rows_.size(); ++i) {
      if (moves_with_[i] != i || frame_rows_[i] < 0) continue;
      auto rows = basis.middleRows<6>(frame_rows_[i]);
      const Eigen::Vector3d centre = state_.poses[i].tail<3>();
      rows.block<3, 3>(3, 0).setIdentity();
      rows.block<3, 3>(0, 3) = -state_.reference_rotations[i];
      for (int axis = 0; axis < 3; ++axis) {
        rows.block<3, 1>(3, 3 + axis) = Eigen::Vector3d::Unit(axis).cross(centre);
      }
      rows.block<3, 1>(3, 6) = centre;
    }
    // Gram-Schmidt; the second round takes away what rounding left in the first.
    for (int round = 0; round < 2; ++round) {
      for (int i = 0; i < 7; ++i) {
        for (int j = 0; j < i; ++j) basis.col(i) -= basis.col(j).dot(basis.col(i)) * basis.col(j);
        basis.col(i).normalize();
      }
    }
    null_space_ = std::move(basis);
  }

  // With the orthonormal null space N and any a > 0, S^+ = (S + a N N^T)^-1 - N N^T / a.
  void Factorise() {
    FindNullSpace();
    null_weight_ = matrix_.diagonal().mean();
    matrix_.triangularView<Eigen::Lower>() += null_weight_ * null_space_ * null_space_.transpose();
    scale_ = matrix_.diagonal().cwiseSqrt().cwiseInverse();
    matrix_ = scale_.asDiagonal() * matrix_ * scale_.asDiagonal();
    matrix_.diagonal().array() += kRidge;
    factor_.compute(matrix_);
  }

  // The diagonal of sigma0^2 S^+ from row `first` on: with S + a N N^T = L L^T, column i of L^-1 has the
  // squared length (L L^T)^-1_ii.
  Eigen::VectorXd Variances(Eigen::Index first) const {
    const Eigen::Index n = size_ - first;
    if (n == 0) return {};  // nothing is free: Eigen's solver would refer to an element that does not exist
    if (factor_.info() != Eigen::Success) return Eigen::VectorXd::Constant(n, kInfinity);
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(size_, n);
    columns.bottomRows(n).setIdentity();
    factor_.matrixL().solveInPlace(columns);
    const Eigen::VectorXd regular =
        columns.colwise().squaredNorm().transpose().cwiseProduct(scale_.tail(n).cwiseAbs2());
    const Eigen::VectorXd gauge = null_space_.bottomRows(n).rowwise().squaredNorm() / null_weight_;
    return sigma0_ * sigma0_ * (regular - gauge).cwiseMax(0);
  }

  std::vector<PoseUncertainty> Poses(const Eigen::VectorXd& variances) const {
    double extent = 0;
    for (const PoseVector& pose : state_.poses) extent = std::max(extent, pose.tail<3>().norm());
    std::vector<PoseUncertainty> poses;
    for (const Eigen::Index row : frame_rows_) {
      poses.push_back(
          row < 0 ? PoseUncertainty{kInfinity, kInfinity}
                  : PoseUncertainty{std::sqrt(variances.segment<3>(row).sum()) * 180 / std::numbers::pi,
                                    std::sqrt(variances.segment<3>(row + 3).sum()) / extent});
    }
    return poses;
  }

  const io::ColmapModel& model_;
  const std::vector<FreeIntrinsics>& free_;
  const BundleState state_;
  const std::vector<std::size_t> lens_owners_, moves_with_;
  std::vector<Eigen::Index> frame_rows_, focal_rows_, lens_rows_;
  std::vector<std::vector<int>> lens_indices_;  // of the free parameters
  Eigen::Index size_ = 0, n_pose_rows_ = 0;
  Eigen::MatrixXd matrix_, null_space_;
  Eigen::VectorXd scale_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  double null_weight_ = 0, sigma0_ = 0, sum_w_ = 0, sum_w2_s_ = 0, sum_slope_ = 0, sum_slope2_ = 0;
};

}  // namespace

BundleUncertainty EstimateUncertainty(const io::ColmapModel& model,
                                      const std::vector<FreeIntrinsics>& free,
                                      bool with_poses,
                                      const std::vector<std::size_t>& moves_with) {
  const io::PromptStop stop;  // for a thousand pictures, the factorisation takes many seconds
  return ReducedSystem(model, free, moves_with.empty() ? MovingAlone(model.scene.frames.size()) : moves_with)
      .Solve(with_poses);
}

}  // namespace sfm
