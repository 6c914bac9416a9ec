// The residual and its analytic Jacobians against the scene's own projection and against differences.
#include "sfm/bundle/reprojection_cost.h"

#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include "sfm/bundle/bundle_state.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

using Eigen::Vector3d;

TEST(ReprojectionCost, ResidualIsTheProjectionOfTheScene) {
  const io::ColmapModel model = RingModel(5, 30, DistortedCamera(), 0, 1);
  const sfm::BundleState state = sfm::ToBundleState(model.scene);
  for (const io::Observation& o : model.observations) {
    const auto frame = static_cast<std::size_t>(o.frame_index),
               point = static_cast<std::size_t>(o.point_index);
    const double* intrinsics = state.intrinsics[0].data();
    const double* parameters[] = {
        state.poses[frame].data(), state.points[point].data(), intrinsics, intrinsics + 1};
    Eigen::Vector2d residual;
    sfm::ReprojectionCost(o.xy, o.sigma, state.reference_rotations[frame])
        .Evaluate(parameters, residual.data(), nullptr);
    EXPECT_LT(residual.norm(), 1e-10);  // 1e-16 x 640 px x a few roundings
  }
  EXPECT_GT(model.observations.size(), 100u);
}

// Central differences (h = 1e-6 of each parameter's size: error about h^2 and 1e-16 / h, 1e-9 relative of a
// Jacobian of some 1000 px), and Ceres' own Ridders extrapolation.
TEST(ReprojectionCost, JacobiansAgreeWithDifferences) {
  std::mt19937_64 random(3), axes(4);
  int cases = 0;
  for (const double turn : {0.0, 1e-9, 1e-5, 2e-4, 0.1, 1.0, 2.5}) {
    for (int i = 0; i < 20; ++i, ++cases) {
      const Eigen::Matrix3d reference(
          Eigen::AngleAxisd(Uniform(&random), RandomVector(&random, 1).normalized()));
      sfm::PoseVector pose;
      pose << turn * RandomVector(&random, 1).normalized(), RandomVector(&random, 1);
      const Eigen::Matrix3d rotation = sfm::RotationFromVector(pose.head<3>()) * reference;
      EXPECT_NEAR((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-14);
      Vector3d point =
          pose.tail<3>() + rotation.transpose() * (Vector3d(0, 0, -4) + RandomVector(&random, 1.5));
      sfm::IntrinsicVector intrinsics = sfm::ToVector(DistortedCamera());
      const Eigen::Matrix3d observer_from_cam(
          Eigen::AngleAxisd(i % 2 ? 0.1 : 0.0, RandomVector(&axes, 1).normalized()));
      const sfm::ReprojectionCost cost({300, 200}, 1.7, reference, observer_from_cam);

      double* blocks[] = {pose.data(), point.data(), intrinsics.data(), intrinsics.data() + 1};
      const int sizes[] = {6, 3, 1, sfm::kLensIntrinsics};
      Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> analytic[4];
      double* jacobians[4];
      for (int b = 0; b < 4; ++b) analytic[b].resize(2, sizes[b]), jacobians[b] = analytic[b].data();
      Eigen::Vector2d residual, plus, minus;
      cost.Evaluate(blocks, residual.data(), jacobians);
      for (int b = 0; b < 4; ++b) {
        for (int k = 0; k < sizes[b]; ++k) {
          const double value = blocks[b][k], h = 1e-6 * std::max(1.0, std::abs(value));
          blocks[b][k] = value + h;
          cost.Evaluate(blocks, plus.data(), nullptr);
          blocks[b][k] = value - h;
          cost.Evaluate(blocks, minus.data(), nullptr);
          blocks[b][k] = value;
          const Eigen::Vector2d numeric = (plus - minus) / (2 * h);
          EXPECT_LT((numeric - analytic[b].col(k)).norm(), 1e-6 * (1 + analytic[b].col(k).norm()))
              << "turn " << turn << " block " << b << " parameter " << k;
        }
      }
      ceres::NumericDiffOptions options;
      const ceres::GradientChecker checker(
          &cost, static_cast<const std::vector<const ceres::Manifold*>*>(nullptr), options);
      ceres::GradientChecker::ProbeResults results;
      EXPECT_TRUE(checker.Probe(blocks, 1e-6, &results)) << results.error_log;
    }
  }
  EXPECT_EQ(cases, 140);
}

}  // namespace
