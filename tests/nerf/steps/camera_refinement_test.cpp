// Refined cameras: their gradients, when views move and when they stop, and what that is worth in training.
#include "nerf/steps/camera_refinement.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/base/random.h"
#include "nerf/training/trainer.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"
#include "tests/support/scenes/small_training.h"

namespace nerf {
namespace {

using tests::Behind;

Eigen::Vector3d Uniform(std::uint64_t index) {
  io::Random random(5, io::Stream::kInit, 7, index);
  const auto next = [&] { return 2.0 * random.Uniform() - 1; };
  const double x = next(), y = next(), z = next();
  return {x, y, z};
}

io::Rigid3d Turned(const io::Rigid3d& pose, const Vector6d& motion) {
  const Eigen::Vector3d w = motion.tail<3>();
  io::Rigid3d turned = pose;
  turned.translation += pose.rotation * motion.head<3>();
  if (w.norm() > 0) turned.rotation = pose.rotation * Eigen::AngleAxisd(w.norm(), w.normalized());
  return turned;
}

// A loss that is a smooth function of the samples' positions in the unit cube: sum sin(k . unit + i).
const Eigen::Vector3d kWave(9, -7, 8);

// Rays of two views, one inside the inner cube of a contracted scene and one outside, with samples inside,
// outside and at infinity; against central differences of the loss over each parameter of a pose.
TEST(CameraRefinement, GradientsAreThoseOfThePoses) {
  const TempDir dir;
  io::Scene scene = tests::BallScene(dir.path(), 2, 0, {.behind = Behind::kRoom});
  scene.frames[1].world_from_cam.translation *= 0.2;
  Dataset dataset = LoadDataset(scene, 1);
  const SceneContraction contraction = {{0.1f, 0.2f, -0.1f}, 1.5f, true};
  const std::vector<float> ts = {0.3f, 1.1f, 2.6f, 4.2f, 7.5f, std::numeric_limits<float>::infinity()};
  const auto batch_of = [&](const std::vector<io::Rigid3d>& poses) {
    RayBatch batch;
    for (std::size_t v = 0; v < 2; ++v) {
      const RayCamera camera(scene.cameras[0], poses[v]);
      for (int k = 0; k < 40; ++k) batch.rays.push_back({.view = v, .ray = camera.RayThrough(k, 47 - k)});
    }
    return batch;
  };
  const auto unit_of = [&](const Ray& ray, float t) {
    float x[3], unit[3];
    for (int i = 0; i < 3; ++i) x[i] = ray.origin[i] + t * ray.direction[i];
    std::isinf(t) ? contraction.ToUnitAtInfinity(ray.direction, unit) : contraction.ToUnit(x, unit);
    return Eigen::Vector3d(unit[0], unit[1], unit[2]);
  };
  const auto loss = [&](const std::vector<io::Rigid3d>& poses) {
    double sum = 0;
    for (const BatchRay& ray : batch_of(poses).rays) {
      for (std::size_t i = 0; i < ts.size(); ++i)
        sum += std::sin(kWave.dot(unit_of(ray.ray, ts[i])) + static_cast<double>(i));
    }
    return sum;
  };
  const std::vector<io::Rigid3d> poses = {scene.frames[0].world_from_cam, scene.frames[1].world_from_cam};
  const RayBatch batch = batch_of(poses);
  ShardSamples samples;
  UnitGradients gradients;
  samples.ray_first = {0};
  for (const BatchRay& ray : batch.rays) {
    for (std::size_t i = 0; i < ts.size(); ++i) {
      samples.sorted.t.push_back(ts[i]);
      const double phase = kWave.dot(unit_of(ray.ray, ts[i])) + static_cast<double>(i);
      for (int axis = 0; axis < 3; ++axis)
        gradients[static_cast<std::size_t>(axis)].push_back(
            static_cast<float>(kWave[axis] * std::cos(phase)));
    }
    samples.ray_first.push_back(static_cast<int>(samples.sorted.t.size()));
  }
  std::vector<float> state;
  std::vector<Vector6d> result;
  CameraRefinement(scene, contraction, 0.5, &dataset, &state)
      .Differentiate(batch, samples, gradients, &result);
  for (std::size_t v = 0; v < 2; ++v) {
    for (int i = 0; i < 6; ++i) {
      constexpr double kStep = 1e-3;
      const auto at = [&](double step) {
        std::vector<io::Rigid3d> moved = poses;
        moved[v] = Turned(poses[v], step * Vector6d::Unit(i));
        return loss(moved);
      };
      const double slope = (at(kStep) - at(-kStep)) / (2 * kStep);
      EXPECT_NEAR(result[v][i], slope, 0.01 * std::fabs(slope) + 0.5) << "view " << v << ", parameter " << i;
    }
    EXPECT_GT(result[v].norm(), 40) << "nothing to compare";
  }
}

// Of three views the first has noise alone, the second a mean gradient of half its noise, until it has moved
// by two pixels, and the third no rays at all.
TEST(CameraRefinement, AViewMovesWhileItsGradientHasAMean) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), 3, 0, {.behind = Behind::kRoom});
  Dataset dataset = LoadDataset(scene, 1);
  const SceneContraction contraction = {{0, 0, 0}, 1, true};
  std::vector<float> state;
  CameraRefinement refinement(scene, contraction, 0.5, &dataset, &state);
  const Ray before = dataset.views[1].camera.RayThrough(10, 20);
  for (std::uint64_t step = 1; step <= 800; ++step) {
    std::vector<Vector6d> gradients(3, Vector6d::Zero());
    for (std::size_t v = 0; v < 2; ++v) {
      const std::uint64_t index = 4 * step + 2 * v;
      gradients[v] << Uniform(index), Uniform(index + 1);
    }
    if (refinement.Motions()[1] < 2) gradients[1].array() += 0.3;
    refinement.Step(step, 0.02, gradients);
    const std::vector<double> motions = refinement.Motions();
    EXPECT_EQ(motions[0], 0);
    EXPECT_EQ(motions[2], 0);
    EXPECT_TRUE(step > 200 || motions[1] == 0) << "before two windows have ended";
  }
  EXPECT_GT(refinement.Motions()[1], 2);
  EXPECT_LT(refinement.Motions()[1], 3.5);
  const Ray after = dataset.views[1].camera.RayThrough(10, 20);
  EXPECT_NE(after.origin[0], before.origin[0]);
  const io::Rigid3d pose = refinement.WorldFromCam()[1];
  EXPECT_LT((pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-6);
  EXPECT_EQ(after.origin[0], static_cast<float>(pose.translation[0]));
  // Down the slope, in the order of the parameters: back along all axes.
  const Eigen::Vector3d moved = scene.frames[1].world_from_cam.rotation.transpose() *
                                (pose.translation - scene.frames[1].world_from_cam.translation);
  EXPECT_LT(moved.sum(), 0);

  // The state makes the cameras again, also over others.
  Dataset fresh = LoadDataset(scene, 1);
  const CameraRefinement resumed(scene, contraction, 0.5, &fresh, &state);
  EXPECT_EQ(fresh.views[1].camera.RayThrough(10, 20).origin[0], after.origin[0]);
  std::vector<float> none;
  const CameraRefinement restarted(scene, contraction, 0.5, &fresh, &none);
  EXPECT_EQ(fresh.views[1].camera.RayThrough(10, 20).origin[0], before.origin[0]);
  state.pop_back();
  EXPECT_THROW(CameraRefinement(scene, contraction, 0.5, &fresh, &state), io::Error);
}

// A pull as strong as that, through every other window.
TEST(CameraRefinement, OneWindowMayBeChance) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), 1, 0, {.behind = Behind::kRoom});
  Dataset dataset = LoadDataset(scene, 1);
  std::vector<float> state;
  CameraRefinement refinement(scene, {{0, 0, 0}, 1, true}, 0.5, &dataset, &state);
  for (std::uint64_t step = 0; step < 400; ++step) {
    Vector6d gradient;
    gradient << Uniform(2 * step), Uniform(2 * step + 1);
    if (step / 100 % 2 == 0) gradient.array() += 0.3;
    refinement.Step(step, 0.02, {gradient});
    ASSERT_EQ(refinement.Motions()[0], 0) << step;
  }
}

constexpr std::size_t kWrongEvery = 4;

// The room, with every fourth of its poses wrong by about two pixels.
io::Scene WrongScene(const io::Scene& right) {
  io::Scene scene = right;
  for (std::size_t v = 0; v < scene.frames.size(); v += kWrongEvery) {
    Vector6d motion = Vector6d::Zero();
    motion.tail<3>() = 2 / scene.cameras[0].fl_x * Uniform(v).normalized();
    scene.frames[v].world_from_cam = Turned(scene.frames[v].world_from_cam, motion);
  }
  return scene;
}

double RotationError(const io::Rigid3d& a, const io::Rigid3d& b) {
  return Eigen::AngleAxisd(a.rotation.transpose() * b.rotation).angle();
}

TEST(CameraRefinement, WrongPosesAreMendedAndRightOnesHardlyMove) {
  const TempDir dir;
  const io::Scene right = tests::BallScene(dir.path(), 32, 0, {.behind = Behind::kRoom}),
                  heldout = tests::BallScene(dir.path(), 4, 0.37, {.behind = Behind::kRoom});
  const io::Scene wrong = WrongScene(right);
  TrainOptions options = tests::SmallTraining(700);
  const auto train = [&](const io::Scene& scene, bool refine) {
    options.refine_cameras = refine;
    const auto folder = dir.path() / "run";
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    return Train(scene, heldout, options, folder);
  };
  const TrainReport refined = train(wrong, true), left = train(wrong, false);
  EXPECT_GT(refined.heldout_psnr, left.heldout_psnr + 0.3);
  EXPECT_TRUE(left.moved_cameras.empty());
  std::vector<double> before, after;
  for (const MovedCamera& camera : refined.moved_cameras) {
    for (std::size_t v = 0; v < wrong.frames.size(); v += kWrongEvery) {
      if (wrong.frames[v].image_path.filename() != camera.name) continue;
      before.push_back(RotationError(wrong.frames[v].world_from_cam, right.frames[v].world_from_cam));
      after.push_back(RotationError(camera.world_from_cam, right.frames[v].world_from_cam));
    }
  }
  ASSERT_GE(before.size(), 6u) << "of 8";
  EXPECT_LT(io::Median(after), 0.5 * io::Median(before));
  // The field is blurred at first, which moves some right ones a little.
  for (const MovedCamera& camera : train(right, true).moved_cameras) EXPECT_LT(camera.motion_px, 1);
}

TEST(CameraRefinement, ResumeContinuesBitForBit) {
  const TempDir dir;
  const io::Scene scene = WrongScene(tests::BallScene(dir.path(), 32, 0, {.behind = Behind::kRoom}));
  TrainOptions options = tests::SmallTraining(0);
  // From step 200 on, independent of the number of steps.
  options.schedule =
      TrainingSchedule{.entry_moments = true, .hold = 1, .first_step_scale = 1, .samples_per_pixel_from = 1};
  const auto train_to = [&](int steps, const std::string& folder) {
    std::filesystem::create_directories(dir / folder);
    options.steps = steps;
    return Train(scene, {}, options, dir / folder);
  };
  train_to(200, "straight");
  std::filesystem::copy(dir / "straight", dir / "cut");
  const TrainReport straight = train_to(260, "straight");
  train_to(230, "cut");
  const TrainReport cut = train_to(260, "cut");
  ASSERT_EQ(straight.moved_cameras.size(), cut.moved_cameras.size());
  ASSERT_GE(straight.moved_cameras.size(), 1u);
  for (std::size_t i = 0; i < straight.moved_cameras.size(); ++i) {
    const MovedCamera &a = straight.moved_cameras[i], &b = cut.moved_cameras[i];
    EXPECT_EQ(a.motion_px, b.motion_px);
    EXPECT_EQ(a.world_from_cam.rotation, b.world_from_cam.rotation);
    EXPECT_EQ(a.world_from_cam.translation, b.world_from_cam.translation);
  }
}

}  // namespace
}  // namespace nerf
