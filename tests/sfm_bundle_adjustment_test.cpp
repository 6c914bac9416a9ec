// Bundle adjustment on synthetic models with known truth, and against independent solutions by Ceres: dense
// QR in a free gauge, ceres::Covariance, ceres::GradientChecker.
#include "sfm/bundle_adjustment.h"

#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include "io/error.h"
#include "sfm/bundle_state.h"
#include "sfm/bundle_uncertainty.h"
#include "sfm/observation_filter.h"
#include "tests/sfm_synthetic_model.h"
#include "tests/temp_dir.h"

namespace {

using Eigen::Vector3d;
using sfm::FreeIntrinsics;

constexpr FreeIntrinsics kFocal = {.focal = true};
constexpr FreeIntrinsics kAll = {true, true, true, true, true, true};
// Ends only where rounding does.
sfm::AdjustmentOptions Tight(const FreeIntrinsics& free, std::size_t n_cameras = 1) {
  return {.free = std::vector(n_cameras, free), .max_iterations = 200, .function_tolerance = 1e-15};
}

io::Camera DistortedCamera() {
  io::Camera camera = SmallCamera();
  camera.fl_y = 510, camera.cx = 310, camera.k1 = -0.05, camera.k2 = 0.01, camera.p1 = 1e-3,
  camera.p2 = -2e-3;
  return camera;
}

TEST(ReprojectionCost, ResidualIsTheProjectionOfTheScene) {
  const io::ColmapModel model = RingModel(5, 30, DistortedCamera(), 0, 1);
  const sfm::BundleState state = sfm::ToBundleState(model.scene);
  for (const io::Observation& o : model.observations) {
    const auto frame = static_cast<std::size_t>(o.frame_index),
               point = static_cast<std::size_t>(o.point_index);
    const double* parameters[] = {
        state.poses[frame].data(), state.points[point].data(), state.intrinsics[0].data()};
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
  std::mt19937_64 random(3);
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
      const sfm::ReprojectionCost cost({300, 200}, 1.7, reference);

      double* blocks[] = {pose.data(), point.data(), intrinsics.data()};
      const int sizes[] = {6, 3, sfm::kIntrinsics};
      Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> analytic[3];
      double* jacobians[3];
      for (int b = 0; b < 3; ++b) analytic[b].resize(2, sizes[b]), jacobians[b] = analytic[b].data();
      Eigen::Vector2d residual, plus, minus;
      cost.Evaluate(blocks, residual.data(), jacobians);
      for (int b = 0; b < 3; ++b) {
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

TEST(BundleAdjustment, NoiseFreeModelIsRestored) {
  int cases = 0;
  for (const bool all : {false, true}) {
    for (std::uint64_t seed = 0; seed < 3; ++seed, ++cases) {
      const io::Camera camera = all ? DistortedCamera() : SmallCamera();
      const io::ColmapModel truth = RingModel(14, 150, camera, 0, seed);
      io::ColmapModel model = truth;
      Perturb(&model, 0.05, 0.02, seed);
      model.scene.cameras[0].fl_x *= 1.03, model.scene.cameras[0].fl_y *= 1.03;
      if (all) model.scene.cameras[0].cx += 10, model.scene.cameras[0].k1 = 0;
      const auto report = sfm::AdjustBundle(&model, Tight(all ? kAll : kFocal));
      EXPECT_GT(report.initial_cost, 1e3);
      EXPECT_LT(report.final_cost, 1e-12);
      const PoseDifference difference = Compare(model.scene, truth.scene);
      EXPECT_LT(difference.rotation_deg, 1e-6);
      EXPECT_LT(difference.centre, 1e-8);
      EXPECT_LT((sfm::ToVector(model.scene.cameras[0]) - sfm::ToVector(camera)).norm(), 1e-5);
      if (!all) {
        io::Camera held = model.scene.cameras[0];  // but for the focal length
        EXPECT_EQ(held.fl_x, held.fl_y);
        held.fl_x = held.fl_y = camera.fl_x;
        EXPECT_EQ(held, camera);
      }
    }
  }
  EXPECT_EQ(cases, 6);
}

TEST(BundleAdjustment, HalfAPixelOfNoiseCostsLessThanATenthOfADegree) {
  const io::ColmapModel truth = RingModel(14, 300, SmallCamera(), 0.5, 4);
  io::ColmapModel model = truth;
  Perturb(&model, 0.05, 0.02, 4);
  EXPECT_TRUE(sfm::AdjustBundle(&model, {.free = {kFocal}}).converged);
  EXPECT_LT(Compare(model.scene, truth.scene).rotation_deg, 0.1);
  io::ColmapModel mismatched = truth;  // one in ten observations points anywhere
  std::mt19937_64 random(9);
  for (std::size_t i = 0; i < mismatched.observations.size(); i += 10) {
    mismatched.observations[i].xy = {640 * Uniform(&random), 480 * Uniform(&random)};
  }
  sfm::AdjustBundle(&mismatched, {.free = {kFocal}});
  EXPECT_LT(Compare(mismatched.scene, truth.scene).rotation_deg, 0.1);
}

// The same cost, put together by the test: no gauge, no Schur complement.
double SolveByDenseQr(io::ColmapModel* model, const FreeIntrinsics& free) {
  sfm::BundleState state = sfm::ToBundleState(model->scene);
  ceres::Problem problem;
  for (const io::Observation& o : model->observations) {
    const auto frame = static_cast<std::size_t>(o.frame_index);
    problem.AddResidualBlock(new sfm::ReprojectionCost(o.xy, o.sigma, state.reference_rotations[frame]),
                             new ceres::CauchyLoss(1.0),
                             state.poses[frame].data(),
                             state.points[static_cast<std::size_t>(o.point_index)].data(),
                             state.intrinsics[0].data());
  }
  problem.SetManifold(state.intrinsics[0].data(),
                      new ceres::SubsetManifold(sfm::kIntrinsics, sfm::HeldIndices(free)));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-15;
  options.gradient_tolerance = options.parameter_tolerance = 0;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  sfm::UpdateScene(state, &model->scene);
  return summary.final_cost;
}

// Points from 0.3 to 100 units before cameras that walk straight on by 0.4.
io::ColmapModel Corridor(double noise_px) {
  io::ColmapModel model;
  model.scene.cameras = {SmallCamera()};
  std::mt19937_64 random(5);
  for (int i = 0; i < 6; ++i) {
    const Vector3d centre = Vector3d(0.4 * i, 0, 0) + RandomVector(&random, 0.05);
    model.scene.frames.push_back(
        {"walk " + std::to_string(i) + ".png", 0, LookAt(centre, centre + Vector3d(1, 0.02 * i, 0))});
  }
  for (int i = 0; i < 60; ++i) {
    const double distance = 0.3 * std::pow(300, Uniform(&random));
    const double side = i % 2 ? 0.3 : -0.3;
    AddPoint(
        &model,
        Vector3d(2 + distance, side * distance * Uniform(&random), 0.3 * distance * (Uniform(&random) - 0.5)),
        noise_px,
        &random);
  }
  return model;
}

TEST(BundleAdjustment, AgreesWithDenseQrInAFreeGauge) {
  io::ColmapModel ring = RingModel(6, 40, SmallCamera(), 0.5, 6);
  io::ColmapModel free_ring = ring;
  const auto report = sfm::AdjustBundle(&ring, Tight(kFocal));
  const double cost = SolveByDenseQr(&free_ring, kFocal);
  EXPECT_NEAR(report.final_cost / cost, 1, 1e-10);
  const PoseDifference difference = Compare(ring.scene, free_ring.scene);
  EXPECT_LT(difference.rotation_deg, 1e-6);  // 1e-8 rad
  EXPECT_LT(difference.centre, 1e-8);

  io::ColmapModel corridor = Corridor(0.3);
  ASSERT_GT(corridor.scene.points.size(), 40u);
  io::ColmapModel free_corridor = corridor;
  const double corridor_cost = SolveByDenseQr(&free_corridor, kFocal);
  EXPECT_NEAR(sfm::AdjustBundle(&corridor, Tight(kFocal)).final_cost / corridor_cost, 1, 1e-6);
}

// The solver takes the same steps in every world; what remains are the digits that the start loses in it:
// 1e-16 x 1e6 = 1e-10 of the ring, less after every step.
TEST(BundleAdjustment, NeitherOriginNorUnitOfLengthMatter) {
  const io::ColmapModel start = [] {
    io::ColmapModel model = RingModel(8, 100, SmallCamera(), 0.5, 7);
    Perturb(&model, 0.03, 0.01, 7);
    return model;
  }();
  io::ColmapModel reference = start;
  sfm::AdjustBundle(&reference, {.free = {kFocal}});
  const Eigen::Matrix3d turn(Eigen::AngleAxisd(1.3, Vector3d(1, -2, 0.5).normalized()));
  const io::Sim3d worlds[] = {{1, turn, {1e6, -1e6, 1e6}}, {1e-3, turn, {0, 0, 0}}, {1e6, turn, {7, 8, 9}}};
  for (const io::Sim3d& world : worlds) {
    io::ColmapModel model = start;
    Move(&model, world);
    sfm::AdjustBundle(&model, {.free = {kFocal}});
    const PoseDifference difference = Compare(model.scene, reference.scene);
    EXPECT_LT(difference.rotation_deg, 1e-9) << world.scale;
    EXPECT_LT(difference.centre, 1e-9) << world.scale;
  }
}

TEST(BundleAdjustment, TheSameModelGivesTheSameBytes) {
  io::ColmapModel a = RingModel(8, 100, SmallCamera(), 0.5, 8), b = a;
  sfm::AdjustBundle(&a, {.free = {kFocal}});
  sfm::AdjustBundle(&b, {.free = {kFocal}});
  for (std::size_t i = 0; i < a.scene.frames.size(); ++i) {
    EXPECT_EQ(a.scene.frames[i].world_from_cam.rotation, b.scene.frames[i].world_from_cam.rotation);
    EXPECT_EQ(a.scene.frames[i].world_from_cam.translation, b.scene.frames[i].world_from_cam.translation);
  }
  EXPECT_EQ(a.scene.cameras, b.scene.cameras);
}

TEST(BundleAdjustment, MoreThanAHundredFramesAreSolvedSparsely) {
  const io::ColmapModel truth = RingModel(104, 60, SmallCamera(), 0, 12);
  io::ColmapModel model = truth;
  Perturb(&model, 0.01, 0.01, 12);
  sfm::AdjustBundle(&model, Tight(kFocal));
  EXPECT_LT(Compare(model.scene, truth.scene).rotation_deg, 1e-6);
}

TEST(BundleAdjustment, ImpossibleObservationsAreRefusedByName) {
  const io::ColmapModel good = RingModel(5, 30, SmallCamera(), 0.5, 10);
  const auto refused = [&](const std::function<void(io::ColmapModel*)>& damage, const std::string& words) {
    io::ColmapModel model = good;
    damage(&model);
    const io::ColmapModel before = model;
    EXPECT_ERROR(sfm::AdjustBundle(&model, {.free = {kFocal}}), io::ExitCode::kNumeric, words);
    EXPECT_EQ(model.scene.frames[0].world_from_cam.rotation, before.scene.frames[0].world_from_cam.rotation);
  };
  const std::string name = "view " + std::to_string(good.observations[7].frame_index) + ".png";
  refused([](io::ColmapModel* m) { m->observations[7].xy.x() = std::nan(""); }, name + ": an observation of");
  refused([](io::ColmapModel* m) { m->observations[7].xy.y() = HUGE_VAL; }, name + ": an observation of");
  refused([](io::ColmapModel* m) { m->scene.points[3].xyz.z() = std::nan(""); }, "point 3 is not finite");
  refused(
      [](io::ColmapModel* m) {
        io::Rigid3d& pose = m->scene.frames[2].world_from_cam;
        pose.rotation = pose.rotation * Vector3d(-1, 1, -1).asDiagonal();  // looks the other way
      },
      "view 2.png: point");
  refused([](io::ColmapModel* m) { m->scene.frames[4].world_from_cam.translation.x() = std::nan(""); },
          "view 4.png");
  refused(
      [](io::ColmapModel* m) {
        for (io::Frame& f : m->scene.frames) f.world_from_cam.translation = Vector3d(0, 0, 9);
        m->observations.clear();
      },
      "all 5 cameras stand at one place");
  refused([](io::ColmapModel* m) { m->observations.clear(); }, "fewer than two pictures");
}

// Covariance by ceres::Covariance in the gauge of a fixed frame, moved to the free network: an S-transform
// P C P^T with P the projector on the complement of the similarities (Baarda, 1973).
TEST(BundleUncertainty, AgreesWithCeres) {
  io::ColmapModel model = RingModel(6, 40, DistortedCamera(), 0.5, 11);
  const FreeIntrinsics free = {.focal = true, .principal_point = true, .k1 = true};
  sfm::AdjustBundle(&model, Tight(free));
  const auto uncertainty = sfm::EstimateUncertainty(model, {free}, true);

  sfm::BundleState state = sfm::ToBundleState(model.scene);
  ceres::Problem problem;
  for (const io::Observation& o : model.observations) {
    const auto frame = static_cast<std::size_t>(o.frame_index);
    problem.AddResidualBlock(new sfm::ReprojectionCost(o.xy, o.sigma, state.reference_rotations[frame]),
                             new ceres::CauchyLoss(1.0),
                             state.poses[frame].data(),
                             state.points[static_cast<std::size_t>(o.point_index)].data(),
                             state.intrinsics[0].data());
  }
  problem.SetParameterBlockConstant(state.poses[0].data());
  problem.SetManifold(state.poses[3].data(), new ceres::SubsetManifold(6, {3}));
  problem.SetManifold(state.intrinsics[0].data(),
                      new ceres::SubsetManifold(sfm::kIntrinsics, sfm::HeldIndices(free)));
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance covariance(options);
  std::vector<const double*> blocks;
  for (const auto& pose : state.poses) blocks.push_back(pose.data());
  blocks.push_back(state.intrinsics[0].data());
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
  const auto known = sfm::EstimateUncertainty(model, {kFocal}, false);
  model.scene.frames.push_back({"extra.png", 1, LookAt({5, 5, 5}, Vector3d::Zero())});
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
  const auto uncertainty = sfm::EstimateUncertainty(model, {kFocal, kFocal}, true);
  EXPECT_TRUE(std::isinf(uncertainty.poses[6].rotation_deg));
  EXPECT_TRUE(std::isinf(uncertainty.intrinsics[1][sfm::kFocal]));
  EXPECT_LT(uncertainty.poses[0].rotation_deg, 0.5);
  // But for sigma0, which counts their residuals and coordinates.
  EXPECT_NEAR(uncertainty.intrinsics[0][sfm::kFocal] / known.intrinsics[0][sfm::kFocal],
              uncertainty.sigma0_px / known.sigma0_px,
              1e-6);
}

TEST(ObservationFilter, RemovesWhatDoesNotAgreeAndRecomputesTheRest) {
  io::ColmapModel model = RingModel(8, 60, SmallCamera(), 0.2, 13);
  const std::size_t n_points = model.scene.points.size(), n_observations = model.observations.size();
  std::vector<io::Observation*> of_point[3];
  for (io::Observation& o : model.observations) {
    if (o.point_index < 3) of_point[o.point_index].push_back(&o);
  }
  of_point[0][0]->xy.x() += 5.5;                                                     // one mismatch
  for (std::size_t i = 1; i < of_point[1].size(); ++i) of_point[1][i]->xy.y() += 6;  // one left: point goes
  io::Point3D& far = model.scene.points[2];  // rays that hardly diverge
  far.xyz = model.scene.frames[0].world_from_cam * Vector3d(0, 0, -1e4);
  for (io::Observation* o : of_point[2]) {
    const auto xy = io::ImgFromCam(
        model.scene.cameras[0],
        model.scene.frames[static_cast<std::size_t>(o->frame_index)].world_from_cam.Inverse() * far.xyz);
    o->xy = xy ? *xy : Eigen::Vector2d(0, 0);
  }
  const std::size_t of_removed = of_point[1].size() + of_point[2].size();
  const auto report = sfm::RemoveWeakObservations(&model);
  EXPECT_EQ(report.removed_points, 2);
  EXPECT_EQ(report.removed_observations, static_cast<int>(of_removed + 1));
  EXPECT_EQ(model.scene.points.size(), n_points - 2);
  EXPECT_EQ(model.observations.size(), n_observations - of_removed - 1);
  EXPECT_NEAR(report.rms_px, 0.2 * std::sqrt(2), 0.02);

  // The model reads back as it is: errors, tracks and indices are what the reader computes.
  const TempDir folder;
  io::WriteColmapModel(folder.path(), model);
  const io::ColmapModel read = io::ReadColmapModel(folder.path());
  EXPECT_EQ(read.observations, model.observations);
  EXPECT_NEAR(read.mean_reprojection_error_px, model.mean_reprojection_error_px, 1e-9);
  EXPECT_EQ(read.mean_track_length, model.mean_track_length);
  double error_sum = 0;
  for (const io::Point3D& p : model.scene.points)
    error_sum += p.error_px * static_cast<double>(p.frame_indices.size());
  EXPECT_NEAR(
      error_sum / static_cast<double>(model.observations.size()), model.mean_reprojection_error_px, 1e-12);
}

}  // namespace
