// Stated uncertainties against ceres::Covariance and against the errors of many adjustments.
#include "sfm/bundle/bundle_uncertainty.h"

#include <gtest/gtest.h>

#include "sfm/bundle/bundle_adjustment.h"
#include "tests/support/scenes/sfm_bundle_problem.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

using Eigen::Vector3d;
using sfm::FreeIntrinsics;

constexpr FreeIntrinsics kFocalAlone = {.focal = true};

// Covariance by ceres::Covariance in the gauge of a fixed frame, moved to the free network: an S-transform
// P C P^T with P the projector on the complement of the similarities (Baarda, 1973).
TEST(BundleUncertainty, AgreesWithCeres) {
  io::ColmapModel model = RingModel(6, 40, DistortedCamera(), 0.5, 11);
  const FreeIntrinsics free = {.focal = true, .principal_point = true, .k1 = true};
  sfm::AdjustBundle(&model, Tight({free}));
  const auto uncertainty = sfm::EstimateUncertainty(model, {free}, true);

  sfm::BundleState state = sfm::ToBundleState(model.scene);
  ceres::Problem problem;
  AddResiduals(model, {free}, &state, &problem);
  HoldIntrinsics({free}, &state, &problem);
  problem.SetParameterBlockConstant(state.poses[0].data());
  problem.SetManifold(state.poses[3].data(), new ceres::SubsetManifold(6, {3}));
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance covariance(options);
  std::vector<const double*> blocks;
  for (const auto& pose : state.poses) blocks.push_back(pose.data());
  blocks.push_back(state.intrinsics[0].data());
  blocks.push_back(state.intrinsics[0].data() + 1);
  ASSERT_TRUE(covariance.Compute(blocks, &problem));
  const int n = 36 + sfm::kIntrinsics;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> fixed(n, n);
  ASSERT_TRUE(covariance.GetCovarianceMatrix(blocks, fixed.data()));

  Eigen::MatrixXd similarities = Eigen::MatrixXd::Zero(n, 7);
  for (int i = 0; i < 6; ++i) {
    const auto& pose = state.poses[static_cast<std::size_t>(i)];
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d unit = Vector3d::Unit(axis);
      similarities.block<3, 1>(6 * i + 3, axis) = unit;
      similarities.block<3, 1>(6 * i, 3 + axis) =
          -state.reference_rotations[static_cast<std::size_t>(i)] * unit;
      similarities.block<3, 1>(6 * i + 3, 3 + axis) = unit.cross(pose.tail<3>());
    }
    similarities.block<3, 1>(6 * i + 3, 6) = pose.tail<3>();
  }
  const Eigen::MatrixXd projector =
      Eigen::MatrixXd::Identity(n, n) -
      similarities * (similarities.transpose() * similarities).inverse() * similarities.transpose();
  const Eigen::MatrixXd expected = projector * fixed * projector.transpose();

  double extent = 0;
  for (const auto& pose : state.poses) extent = std::max(extent, pose.tail<3>().norm());
  for (int i = 0; i < 6; ++i) {
    const auto& pose = uncertainty.poses[static_cast<std::size_t>(i)];
    const double rotation = uncertainty.sigma0_px * std::sqrt(expected.block<3, 3>(6 * i, 6 * i).trace());
    const double centre =
        uncertainty.sigma0_px * std::sqrt(expected.block<3, 3>(6 * i + 3, 6 * i + 3).trace());
    EXPECT_NEAR(pose.rotation_deg / (rotation * 180 / std::numbers::pi), 1, 1e-6);
    EXPECT_NEAR(pose.centre / (centre / extent), 1, 1e-6);
  }
  for (int i = 0; i < sfm::kIntrinsics; ++i) {
    const double sigma = uncertainty.sigma0_px * std::sqrt(expected(36 + i, 36 + i));
    EXPECT_NEAR(uncertainty.intrinsics[0][i], sigma, 1e-6 * sigma) << i;
  }
  EXPECT_EQ((uncertainty.intrinsics[0].array() > 0).count(), 4);
}

// The same capture with a camera for all pictures and with one per picture that shares its lens: where all
// focal lengths are held, nothing differs; where each is free, it is less certain than the common one.
TEST(BundleUncertainty, SharedLensesAreOneLens) {
  io::ColmapModel shared = RingModel(6, 60, SmallCamera(), 0.5, 3);
  io::ColmapModel own = shared;
  own.scene.cameras.assign(6, SmallCamera());
  std::vector<FreeIntrinsics> held(6, {.k1 = true}), free(6, {.focal = true, .k1 = true});
  for (std::size_t i = 0; i < 6; ++i) {
    own.scene.frames[i].camera_index = static_cast<int>(i);
    held[i].lens_of = free[i].lens_of = i == 2 ? -1 : 2;
  }
  const auto expected = sfm::EstimateUncertainty(shared, {{.k1 = true}}, true);
  const auto found = sfm::EstimateUncertainty(own, held, true);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(found.intrinsics[i][sfm::kK1] / expected.intrinsics[0][sfm::kK1], 1, 1e-6);
    EXPECT_EQ(found.intrinsics[i][sfm::kFocal], 0);
    EXPECT_NEAR(found.poses[i].centre / expected.poses[i].centre, 1, 1e-6);
  }
  const auto common = sfm::EstimateUncertainty(shared, {{.focal = true, .k1 = true}}, true);
  const auto each = sfm::EstimateUncertainty(own, free, true);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_GT(each.intrinsics[i][sfm::kFocal], common.intrinsics[0][sfm::kFocal]);
    EXPECT_LT(each.intrinsics[i][sfm::kFocal], 20 * common.intrinsics[0][sfm::kFocal]);
    EXPECT_EQ(each.intrinsics[i][sfm::kK1], each.intrinsics[0][sfm::kK1]);
    EXPECT_GT(each.poses[i].centre, common.poses[i].centre);
  }
}

// Errors of 200 adjustments divided by their stated sigma: for a correct sigma the mean square is 1, with a
// spread of sqrt(2 / 200) = 0.1; 3 times that is allowed (measured over 700: 1.15, 1.05, 1.06). With Gaussian
// noise of 0.5 px, s is exponential with mean 0.5 px^2, hence E[w] = 0.723, E[w^2] = 0.555, E[w^2 s] = 0.168
// and sigma0 = sqrt(0.168 / 2 * 0.723) / 0.555 = 0.444 px for many observations.
TEST(BundleUncertainty, StatedSigmasAreTheErrorsOfTheAdjustment) {
  const FreeIntrinsics free = {.focal = true, .principal_point = true};
  const int n = 200;
  double focal = 0, cx = 0, cy = 0, sigma0 = 0;
  for (int seed = 0; seed < n; ++seed) {
    io::ColmapModel model = RingModel(6, 60, SmallCamera(), 0.5, static_cast<std::uint64_t>(seed));
    sfm::AdjustBundle(&model, {.free = {free}});
    const auto uncertainty = sfm::EstimateUncertainty(model, {free}, false);
    const sfm::IntrinsicVector pull = (sfm::ToVector(model.scene.cameras[0]) - sfm::ToVector(SmallCamera()))
                                          .cwiseQuotient(uncertainty.intrinsics[0]);
    focal += pull[sfm::kFocal] * pull[sfm::kFocal] / n;
    cx += pull[sfm::kCx] * pull[sfm::kCx] / n;
    cy += pull[sfm::kCy] * pull[sfm::kCy] / n;
    sigma0 += uncertainty.sigma0_px / n;
  }
  EXPECT_NEAR(focal, 1, 0.3);
  EXPECT_NEAR(cx, 1, 0.3);
  EXPECT_NEAR(cy, 1, 0.3);
  EXPECT_NEAR(sigma0, 0.444, 0.02);
}

TEST(BundleUncertainty, UnobservedAndUndeterminedParametersAreInfiniteOrLarge) {
  io::ColmapModel model = RingModel(6, 60, SmallCamera(), 0.5, 3);
  const auto known = sfm::EstimateUncertainty(model, {kFocalAlone}, false);
  model.scene.frames.push_back({"extra.png", 1, LookAt({5, 5, 5}, Vector3d::Zero(), Vector3d::UnitZ())});
  model.scene.cameras.push_back(SmallCamera());
  // Points that are seen once say nothing about anything but themselves.
  std::vector<bool> is_copied(model.scene.points.size());
  for (const io::Observation& o : std::vector(model.observations)) {
    const auto point = static_cast<std::size_t>(o.point_index);
    if (is_copied[point]) continue;
    is_copied[point] = true;
    model.observations.push_back({o.frame_index, static_cast<int>(model.scene.points.size()), o.xy});
    model.scene.points.push_back(model.scene.points[point]);
  }
  const auto uncertainty = sfm::EstimateUncertainty(model, {kFocalAlone, kFocalAlone}, true);
  EXPECT_TRUE(std::isinf(uncertainty.poses[6].rotation_deg));
  EXPECT_TRUE(std::isinf(uncertainty.intrinsics[1][sfm::kFocal]));
  EXPECT_LT(uncertainty.poses[0].rotation_deg, 0.5);
  // But for sigma0, which counts their residuals and coordinates.
  EXPECT_NEAR(uncertainty.intrinsics[0][sfm::kFocal] / known.intrinsics[0][sfm::kFocal],
              uncertainty.sigma0_px / known.sigma0_px,
              1e-6);
}

}  // namespace
