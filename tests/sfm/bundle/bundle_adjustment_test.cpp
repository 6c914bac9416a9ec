// Bundle adjustment on synthetic models with known truth, and against dense QR in a free gauge.
#include "sfm/bundle/bundle_adjustment.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/pose_difference.h"
#include "tests/support/scenes/sfm_bundle_problem.h"
#include "tests/support/scenes/sfm_synthetic_model.h"

namespace {

using Eigen::Vector3d;
using sfm::FreeIntrinsics;

constexpr FreeIntrinsics kFocal = {.focal = true};
constexpr FreeIntrinsics kAll = {true, true, true, true, true, true};

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
      const auto report = sfm::AdjustBundle(&model, Tight({all ? kAll : kFocal}));
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

double SolveByDenseQr(io::ColmapModel* model, const std::vector<FreeIntrinsics>& free) {
  sfm::BundleState state = sfm::ToBundleState(model->scene);
  ceres::Problem problem;
  AddResiduals(*model, free, &state, &problem);
  HoldIntrinsics(free, &state, &problem);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-15;
  options.gradient_tolerance = options.parameter_tolerance = 0;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const std::vector<std::size_t> owners = sfm::LensOwners(free);
  for (std::size_t i = 0; i < free.size(); ++i) {
    state.intrinsics[i].tail<sfm::kLensIntrinsics>() =
        state.intrinsics[owners[i]].tail<sfm::kLensIntrinsics>();
  }
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
    const Vector3d target = centre + Vector3d(1, 0.02 * i, 0);
    model.scene.frames.push_back(
        {"walk " + std::to_string(i) + ".png", 0, LookAt(centre, target, Vector3d::UnitZ())});
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
  const auto report = sfm::AdjustBundle(&ring, Tight({kFocal}));
  const double cost = SolveByDenseQr(&free_ring, {kFocal});
  EXPECT_NEAR(report.final_cost / cost, 1, 1e-10);
  const PoseDifference difference = Compare(ring.scene, free_ring.scene);
  EXPECT_LT(difference.rotation_deg, 1e-6);  // 1e-8 rad
  EXPECT_LT(difference.centre, 1e-8);

  io::ColmapModel corridor = Corridor(0.3);
  ASSERT_GT(corridor.scene.points.size(), 40u);
  io::ColmapModel free_corridor = corridor;
  const double corridor_cost = SolveByDenseQr(&free_corridor, {kFocal});
  EXPECT_NEAR(sfm::AdjustBundle(&corridor, Tight({kFocal})).final_cost / corridor_cost, 1, 1e-6);
}

// Focused anew for every picture: focal lengths of their own, one lens.
TEST(BundleAdjustment, PicturesShareALensButNotTheFocalLength) {
  const FreeIntrinsics own = {.focal = true, .principal_point = true, .k1 = true};
  io::ColmapModel truth = OwnFocals(8, 80, 0, 14), noisy = OwnFocals(8, 80, 0.5, 14);
  std::vector<FreeIntrinsics> free(8, own);
  for (std::size_t i = 0; i < 8; ++i) free[i].lens_of = i == 3 ? -1 : 3;  // not the first one

  io::ColmapModel model = truth;
  Perturb(&model, 0.03, 0.01, 14);
  for (io::Camera& camera : model.scene.cameras) {
    camera.fl_x = camera.fl_y = 500, camera.cx += 5, camera.k1 = 0;
  }
  const auto report = sfm::AdjustBundle(&model, Tight(free));
  EXPECT_LT(report.final_cost, 1e-12);
  EXPECT_LT(Compare(model.scene, truth.scene).centre, 1e-8);
  for (std::size_t i = 0; i < 8; ++i) {
    const auto expected = sfm::ToVector(truth.scene.cameras[i]),
               found = sfm::ToVector(model.scene.cameras[i]);
    EXPECT_LT((expected - found).norm(), 1e-5) << i;
  }

  io::ColmapModel by_qr = noisy;
  sfm::AdjustBundle(&noisy, Tight(free));
  SolveByDenseQr(&by_qr, free);
  EXPECT_LT(Compare(noisy.scene, by_qr.scene).centre, 1e-7);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(noisy.scene.cameras[i].k1, noisy.scene.cameras[3].k1);
    EXPECT_NEAR(noisy.scene.cameras[i].fl_x, by_qr.scene.cameras[i].fl_x, 1e-3);
  }
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

TEST(BundleAdjustment, ConjugateGradientsForMoreThanTwoHundredFramesAgree) {
  const io::ColmapModel truth = RingModel(204, 60, SmallCamera(), 0, 12);
  io::ColmapModel model = truth;
  Perturb(&model, 0.01, 0.01, 12);
  sfm::AdjustBundle(&model, Tight({kFocal}));
  EXPECT_LT(Compare(model.scene, truth.scene).rotation_deg, 1e-6);
}

TEST(BundleAdjustment, AnInterruptEndsIt) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";  // a process of its own: signals stay pending
  io::ColmapModel model = RingModel(5, 30, SmallCamera(), 0.5, 10);
  const auto adjust = [&] {
    io::InstallInterruptHandlers();
    raise(SIGTERM);
    try {
      sfm::AdjustBundle(&model, {.free = {kFocal}});
    } catch (const io::Interrupted&) {
      _exit(0);
    }
    _exit(1);
  };
  EXPECT_EXIT(adjust(), testing::ExitedWithCode(0), "");
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
  refused([](io::ColmapModel* m) { m->observations[7].xy.x() = std::nan(""); }, name);
  refused([](io::ColmapModel* m) { m->observations[7].xy.y() = HUGE_VAL; }, name);
  refused([](io::ColmapModel* m) { m->scene.points[3].xyz.z() = std::nan(""); }, "point 3");
  refused(
      [](io::ColmapModel* m) {
        io::Rigid3d& pose = m->scene.frames[2].world_from_cam;
        pose.rotation = pose.rotation * Vector3d(-1, 1, -1).asDiagonal();  // looks the other way
      },
      "view 2.png");
  refused([](io::ColmapModel* m) { m->scene.frames[4].world_from_cam.translation.x() = std::nan(""); },
          "view 4.png");
  refused(
      [](io::ColmapModel* m) {
        m->scene.frames[4].world_from_cam.rotation(0, 0) = std::nan("");
        std::erase_if(m->observations, [](const io::Observation& o) { return o.frame_index == 4; });
      },
      "view 4.png has a pose that is not finite");
  refused([](io::ColmapModel* m) { m->observations[7].xy.x() = 1e200; }, "bundle adjustment failed");
  refused(
      [](io::ColmapModel* m) {
        for (io::Frame& f : m->scene.frames) f.world_from_cam.translation = Vector3d(0, 0, 9);
        m->observations.clear();
      },
      "5 cameras");
  refused([](io::ColmapModel* m) { m->observations.clear(); }, "two pictures");
}

TEST(BundleAdjustment, FramesThatMoveTogetherKeepTheirPlaceAndTurn) {
  const io::ColmapModel truth = PanoramaModel(5, 0);
  io::ColmapModel together = PanoramaModel(5, 0.5);
  std::vector<std::size_t> moves_with;
  std::mt19937_64 random(3);
  for (std::size_t i = 0; i < together.scene.frames.size(); i += 4) {
    const Eigen::Matrix3d turn(Eigen::AngleAxisd(0.03, RandomVector(&random, 1).normalized()));
    const Vector3d shift = RandomVector(&random, 0.05);
    for (std::size_t k = i; k < i + 4; ++k) {
      moves_with.push_back(i + 1);
      io::Rigid3d& pose = together.scene.frames[k].world_from_cam;
      pose = {turn * pose.rotation, pose.translation + shift};
    }
  }
  io::ColmapModel alone = together;
  const sfm::AdjustmentReport report = sfm::AdjustBundle(&together, {.free = {{}}, .moves_with = moves_with});
  EXPECT_TRUE(report.converged);
  for (std::size_t i = 0; i < moves_with.size(); ++i) {
    const io::Rigid3d &own = together.scene.frames[i].world_from_cam,
                      &leading = together.scene.frames[moves_with[i]].world_from_cam;
    EXPECT_LT((own.translation - leading.translation).norm(), 1e-12);
    const Eigen::Matrix3d turn = leading.rotation.transpose() * own.rotation,
                          true_turn = truth.scene.frames[moves_with[i]].world_from_cam.rotation.transpose() *
                                      truth.scene.frames[i].world_from_cam.rotation;
    EXPECT_LT((turn - true_turn).norm(), 1e-9) << i;
  }
  const PoseDifference difference = Compare(together.scene, truth.scene);
  EXPECT_LT(difference.rotation_deg, 0.05);
  EXPECT_LT(difference.centre, 2e-3);
  // What four views know of one place is more than what each knows.
  sfm::AdjustBundle(&alone, {.free = {{}}});
  EXPECT_LT(difference.rotation_deg, 0.7 * Compare(alone.scene, truth.scene).rotation_deg);
}

}  // namespace
