// Training of the `nerf` field end to end on a small ball: quality with each way of sampling, threads,
// resume, and the report's options.
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "nerf/rendering/ray_renderer.h"
#include "nerf/rendering/trained_field.h"
#include "nerf/training/heldout_monitor.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/small_mlp.h"

namespace nerf {
namespace {

using tests::kPrunedFar;
using tests::kStratifiedFar;
using tests::SmallBall;
using tests::SmallMlp;

// Gain over the best constant picture, in dB, on a view that was not trained on.
double LearntDb(const TrainOptions& options, double far) {
  const TempDir dir;
  const io::Scene train = SmallBall(dir.path(), 12, 0, far), heldout = SmallBall(dir.path(), 4, 0.37, far);
  const TrainReport report = Train(train, {}, options, dir.path());
  EXPECT_EQ(report.skipped_steps, 0);
  const RenderedView view =
      TrainedField::Load(dir.path() / "checkpoint.bin")
          ->Render(heldout.cameras[0], heldout.frames[0].world_from_cam, {.threads = 2});
  const double constant = ConstantSquaredError(LoadDataset(heldout, 1), 1.0);
  const double gain = 10 * std::log10(constant / tests::SquaredError(heldout.frames[0], view.rgb));
  std::printf("%.1f dB above the constant picture after %d steps, %.1f samples per ray, %.1f s\n",
              gain,
              options.steps,
              report.samples_per_ray,
              report.train_s);
  return gain;
}

TEST(MlpTraining, LearnsTheBallBetweenOccupiedCells) {
  EXPECT_GE(LearntDb(SmallMlp(70, 256), kPrunedFar), 10);
}

TEST(MlpTraining, LearnsTheBallWithStratifiedSamples) {
  EXPECT_GE(LearntDb(SmallMlp(80, 48, {.n_samples = 32}), kStratifiedFar), 6);
}

TEST(MlpTraining, LearnsTheBallWithImportanceSamples) {
  EXPECT_GE(LearntDb(SmallMlp(70, 48, {.n_samples = 16, .n_importance = 16}), kStratifiedFar), 5);
}

// All that a run leaves behind, but for its duration.
void ExpectSameState(const std::filesystem::path& a_path, const std::filesystem::path& b_path) {
  TrainState a_state, b_state;
  const auto a = ReadCheckpoint(a_path / "checkpoint.bin", &a_state),
             b = ReadCheckpoint(b_path / "checkpoint.bin", &b_state);
  const std::vector<Tensor> a_tensors = a->field->State(), b_tensors = b->field->State();
  ASSERT_EQ(a_tensors.size(), b_tensors.size());
  for (std::size_t i = 0; i < a_tensors.size(); ++i)
    EXPECT_TRUE(std::ranges::equal(a_tensors[i].values, b_tensors[i].values)) << a_tensors[i].name;
  EXPECT_TRUE(a->grid.density() == b->grid.density());
  EXPECT_TRUE(a->grid.distance() == b->grid.distance());
  EXPECT_EQ(a_state.step, b_state.step);
  EXPECT_EQ(a_state.n_rays, b_state.n_rays);
  EXPECT_EQ(a_state.squared_error, b_state.squared_error);
}

std::filesystem::path CopyOf(const std::filesystem::path& run, const std::string& name) {
  const std::filesystem::path folder = run.parent_path() / name;
  std::filesystem::create_directories(folder);
  std::filesystem::copy(run / "checkpoint.bin", folder / "checkpoint.bin");
  return folder;
}

// A run that goes on behind the first rebuild of the occupancy grid (step 192). The next one is at 208, and
// the cut behind it: what rays see then follows from a grid that the densities at that step would not give.
class PrunedRun : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new TempDir;
    scene_ = SmallBall(dir_->path(), 12, 0, kPrunedFar);
    const std::filesystem::path run = *dir_ / "run";
    std::filesystem::create_directories(run);
    Train(scene_, {}, SmallMlp(2, kRays), run);
    TrainState state;
    const auto field = ReadCheckpoint(run / "checkpoint.bin", &state);
    state.step = 190;
    WriteCheckpoint(run / "checkpoint.bin", field.get(), state);
    Train(scene_, {}, SmallMlp(kBegin, kRays), run);
  }
  static void TearDownTestSuite() { delete dir_; }

  static constexpr int kRays = 128, kBegin = 197, kCut = 213, kEnd = 217;
  static TempDir* dir_;
  static io::Scene scene_;
};
TempDir* PrunedRun::dir_;
io::Scene PrunedRun::scene_;

TEST_F(PrunedRun, SameBytesForAnyNumberOfThreads) {
  const auto one = CopyOf(*dir_ / "run", "one"), three = CopyOf(*dir_ / "run", "three");
  TrainOptions options = SmallMlp(kEnd, kRays);
  for (const auto& [threads, folder] : {std::pair(1, one), {3, three}}) {
    options.threads = threads;
    Train(scene_, {}, options, folder);
  }
  ExpectSameState(one, three);
}

TEST_F(PrunedRun, ResumeContinuesBitForBit) {
  const auto straight = CopyOf(*dir_ / "run", "straight"), cut = CopyOf(*dir_ / "run", "cut");
  Train(scene_, {}, SmallMlp(kEnd, kRays), straight);
  Train(scene_, {}, SmallMlp(kCut, kRays), cut);
  const TrainReport report = Train(scene_, {}, SmallMlp(kEnd, kRays), cut);
  ASSERT_FALSE(report.events.empty());
  EXPECT_EQ(report.events[0], "resumed at step 213");
  ExpectSameState(straight, cut);
}

// One of the report's settings takes minutes: it is cut short, and the run goes on as if it had not begun.
TEST(MlpTraining, AnInterruptedStepChangesNothing) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";  // a process of its own: signals stay pending
  const TempDir dir;
  setenv("INTERRUPTED_RUN", (dir / "interrupted").c_str(), 0);  // which that process gets to know so
  const std::filesystem::path interrupted = getenv("INTERRUPTED_RUN"), straight = dir / "straight";
  for (const auto& folder : {interrupted, straight}) std::filesystem::create_directories(folder);
  const io::Scene train = SmallBall(dir.path(), 6, 0, kStratifiedFar);
  const TrainOptions options = SmallMlp(4, 48, {.n_samples = 16});
  const auto interrupt = [&] {
    io::InstallInterruptHandlers();
    raise(SIGTERM);
    try {
      Train(train, {}, options, interrupted);
    } catch (const io::Interrupted&) {
      TrainState state;
      ReadCheckpoint(interrupted / "checkpoint.bin", &state);
      _exit(static_cast<int>(state.step));
    }
    _exit(100);
  };
  EXPECT_EXIT(interrupt(), testing::ExitedWithCode(0), "");
  Train(train, {}, options, straight);
  Train(train, {}, options, interrupted);
  ExpectSameState(straight, interrupted);
}

TEST(HashTraining, ResumeContinuesBitForBit) {
  const TempDir dir;
  const io::Scene scene = SmallBall(dir.path(), 8, 0, kStratifiedFar);
  TrainOptions options;
  options.samples_per_step = 1 << 16;  // so many that the occupancy grid is rebuilt on both sides of the cut
  options.field.log2_hashmap_size = 12;
  options.field.finest_resolution = 64;
  options.field.grid_resolution = 64;
  options.schedule = TrainingSchedule{
      .hold = 1, .first_step_scale = 1, .samples_per_pixel_from = 1};  // independent of `steps`
  for (const auto& [folder, steps] : {std::pair("straight", 45), {"cut", 37}, {"cut", 45}}) {
    options.steps = steps;
    std::filesystem::create_directories(dir / folder);
    Train(scene, {}, options, dir / folder);
  }
  ExpectSameState(dir / "straight", dir / "cut");
}

// The report's rays go through pixel corners, in pictures as in training.
TEST(MlpTraining, TheReportsOptionsTrainAndRender) {
  const TempDir dir;
  const io::Scene scene = SmallBall(dir.path(), 6, 0, kStratifiedFar);
  TrainOptions options = ReportTrainOptions();
  EXPECT_EQ(options.field.mlp.quadrature.n_samples, 192);
  options.field.mlp.quadrature.n_samples = 16;
  options.mlp.rays = 32;
  options.steps = 12;
  options.threads = 2;
  const TrainReport report = Train(scene, {}, options, dir.path());
  EXPECT_EQ(report.steps, 12u);
  EXPECT_EQ(report.skipped_steps, 0);
  EXPECT_EQ(report.samples_per_ray, 16);

  TrainState state;
  const auto scene_field = ReadCheckpoint(dir.path() / "checkpoint.bin", &state);
  EXPECT_EQ(scene_field->field->Config().at("pixel_centres"), 0);
  io::Camera camera = scene.cameras[0];
  const RenderedView view = TrainedField::Load(dir.path() / "checkpoint.bin")
                                ->Render(camera, scene.frames[0].world_from_cam, {.threads = 2});
  io::Workers workers(1);
  double largest[2] = {};
  for (const int half : {0, 1}) {
    const RayCamera rays(camera, scene.frames[0].world_from_cam, 0.5 * half);
    for (int x = 0; x < camera.width; ++x) {
      const Ray ray = rays.RayThrough(x, 12);
      const RenderedRay want = RenderRays(*scene_field, {&ray, 1}, 1, 0.5f, &workers)[0];
      const float got = view.rgb[static_cast<std::size_t>(3 * (12 * camera.width + x))];
      ASSERT_TRUE(std::isfinite(got));
      largest[half] = std::max(largest[half], std::fabs(double{got} - want.rgb[0] - want.transmittance));
    }
  }
  EXPECT_LE(largest[0], 1e-5);
  EXPECT_GT(largest[1], 1e-4) << "corners and centres should differ";
}

}  // namespace
}  // namespace nerf
