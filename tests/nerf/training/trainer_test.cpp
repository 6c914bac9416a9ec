// Training end to end on a scene whose pictures are computed in closed form: quality, determinism, resume,
// checkpoints.
#include "nerf/training/trainer.h"

#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "io/base/hash.h"
#include "nerf/fields/checkpoint.h"
#include "nerf/rendering/trained_field.h"
#include "nerf/training/splat_fit.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"

namespace nerf {
namespace {

using tests::Behind;

constexpr int kSize = 48;

io::Scene MakeScene(const std::filesystem::path& folder,
                    int n_views,
                    double phase,
                    Behind behind = Behind::kNothing) {
  return tests::BallScene(folder, n_views, phase, {.size = kSize, .behind = behind});
}

TrainOptions SmallOptions(int steps) {
  TrainOptions options;
  options.steps = steps;
  options.samples_per_step = 8192;
  options.field.log2_hashmap_size = 12;
  options.field.finest_resolution = 64;
  options.field.grid_resolution = 64;
  return options;
}

TEST(Trainer, AWatcherGetsNewsAndCheckpointsAndMayEndIt) {
  const TempDir dir;
  const io::Scene train = MakeScene(dir.path(), 8, 0);
  TrainOptions options = SmallOptions(0);
  options.steps = 0;
  options.time_s = 600;
  std::vector<TrainingNews> news;
  bool had_checkpoint = false;
  float first_step_scale = 0;  // of the first checkpoint
  std::size_t asked = 0;       // how many news had come when the end was asked for
  options.watcher = [&](const TrainingNews& told) -> WatcherWish {
    news.push_back(told);
    if (!had_checkpoint && std::filesystem::exists(dir.path() / "checkpoint.bin")) {
      had_checkpoint = true;
      TrainState state;
      first_step_scale = ReadCheckpoint(dir.path() / "checkpoint.bin", &state)->step_scale;
    }
    if (had_checkpoint && asked == 0 && news.size() > 2) asked = news.size();
    return {.wants_checkpoint = true, .wants_end = asked > 0};
  };
  const TrainReport report = Train(train, {}, options, dir.path());
  EXPECT_TRUE(report.ended_early);
  ASSERT_GT(asked, 0u);
  const TrainingNews& last = news[asked - 1];
  EXPECT_GT(last.step, news.front().step);
  EXPECT_GT(last.progress, 0);
  EXPECT_LT(last.progress, 0.5);
  EXPECT_NEAR(last.left_s + last.elapsed_s, 600, 1e-6);
  // The rest of the schedule takes a second or 15 % of the time so far, and is gone through to its end.
  EXPECT_GE(report.train_s, last.elapsed_s + 1);
  EXPECT_LT(report.train_s, 1.3 * last.elapsed_s + 5);
  EXPECT_GT(news.back().progress, 0.5);
  TrainState state;
  EXPECT_EQ(ReadCheckpoint(dir.path() / "checkpoint.bin", &state)->step_scale, 1);
  EXPECT_EQ(state.step, report.steps);
  EXPECT_GT(first_step_scale, 1.5);  // training begins with longer intervals
}

// With alpha, and on paper of one colour, which must not become a thing in space.
TEST(Trainer, LearnsABallAndNothingAroundIt) {
  for (const Behind behind : {Behind::kNothing, Behind::kPaper}) {
    SCOPED_TRACE(behind == Behind::kPaper ? "on paper" : "with alpha");
    const TempDir dir;
    const io::Scene train = MakeScene(dir.path(), 16, 0, behind),
                    heldout = MakeScene(dir.path(), 4, 0.37, behind);
    TrainOptions options = SmallOptions(400);
    options.threads = 2;
    const TrainReport report = Train(train, heldout, options, dir.path());
    EXPECT_EQ(report.steps, 400u);
    EXPECT_GE(report.heldout_psnr, 27.0);
    EXPECT_EQ(report.restarts, 0);

    const RenderedView view =
        TrainedField::Load(dir.path() / "checkpoint.bin")
            ->Render(heldout.cameras[0], heldout.frames[0].world_from_cam, {.threads = 2});
    const std::size_t middle = static_cast<std::size_t>(kSize) * kSize / 2 + kSize / 2;
    EXPECT_NEAR(view.depth[middle], 3.2, 0.05);
    EXPECT_GT(view.opacity[middle], 0.99);
    EXPECT_LT(view.opacity[0], 0.01);
    // White is the background of the render options.
    for (std::size_t j = 0; j < 3; ++j)
      EXPECT_NEAR(view.rgb[j], behind == Behind::kPaper ? tests::kPaper[j] / 255.0 : 1.0, 0.01);
  }
}

TEST(Trainer, LearnsOpaquePicturesInContractedSpace) {
  const TempDir dir;
  const io::Scene train = MakeScene(dir.path(), 32, 0, Behind::kRoom),
                  heldout = MakeScene(dir.path(), 4, 0.37, Behind::kRoom);
  TrainOptions options = SmallOptions(600);
  options.threads = 2;
  const TrainReport report = Train(train, heldout, options, dir.path());
  EXPECT_GE(report.heldout_psnr, 22.0);
}

// Splats are of the field that they began on: a field that is trained further gets new ones.
TEST(Trainer, SplatsFollowTheFieldAndAreDoneOnce) {
  const TempDir dir;
  const io::Scene train = MakeScene(dir.path(), 8, 0, Behind::kRoom);
  TrainOptions options = SmallOptions(60);
  const auto state_after = [&] {
    const TrainReport report = Train(train, {}, options, dir.path());
    TrainState state;
    ReadCheckpoint(dir.path() / "checkpoint.bin", &state);
    EXPECT_TRUE(state.splats.moments.empty());
    EXPECT_GE(state.elapsed_s, state.field_s);
    return state;
  };
  const TrainState first = state_after(), again = state_after();
  EXPECT_EQ(first.splats.step, 1u + 60 / kFieldSteps);
  EXPECT_EQ(again.splats.step, first.splats.step);
  EXPECT_EQ(again.splats.squared_error, first.splats.squared_error);
  options.steps = 90;
  const TrainState further = state_after();
  EXPECT_EQ(further.step, 90u);
  EXPECT_EQ(further.splats.step, 1u + 90 / kFieldSteps);
  EXPECT_NE(further.splats.squared_error, first.splats.squared_error);
  const TempDir without;
  options.splats = false;
  Train(train, {}, options, without.path());
  TrainState state;
  EXPECT_EQ(ReadCheckpoint(without.path() / "checkpoint.bin", &state)->splats.size(), 0u);
}

// They read more of the field than its training does: also what is brought up to date only now and then.
TEST(Trainer, SplatsAreTheSameAfterAnInterruptionBeforeTheyBegin) {
  const TempDir straight, interrupted;
  TrainOptions options = SmallOptions(60);
  const auto train = [&](const TempDir& dir) {
    Train(MakeScene(dir.path(), 8, 0, Behind::kRoom), {}, options, dir.path());
    TrainState state;
    return ReadCheckpoint(dir.path() / "checkpoint.bin", &state)->splats;
  };
  const Splats want = train(straight);
  options.splats = false;
  EXPECT_EQ(train(interrupted).size(), 0u);
  options.splats = true;
  const Splats got = train(interrupted);
  EXPECT_GT(want.size(), 0u);
  EXPECT_EQ(got.places, want.places);
  EXPECT_EQ(got.colours, want.colours);
}

TEST(Trainer, SameBytesForAnyNumberOfThreads) {
  const TempDir dir;
  std::set<std::string> hashes;
  std::size_t n_kinds = 0;
  for (const auto& [bf16, behind] :
       {std::pair(false, Behind::kNothing), {true, Behind::kNothing}, {true, Behind::kRoom}}) {
    const io::Scene train = MakeScene(dir.path(), 8, 0, behind);
    for (const int threads : {1, 3}) {
      TrainOptions options = SmallOptions(40);
      options.threads = threads;
      options.field.bf16_table = options.field.bf16_network = bf16;
      const auto folder = dir.path() / (std::to_string(n_kinds) + "_" + std::to_string(threads));
      std::filesystem::create_directories(folder);
      Train(train, {}, options, folder);
      const auto field = TrainedField::Load(folder / "checkpoint.bin");
      const RenderedView view =
          field->Render(train.cameras[0], train.frames[0].world_from_cam, {.threads = threads});
      hashes.insert(io::HashBytes({reinterpret_cast<const char*>(view.rgb.data()), view.rgb.size() * 4}));
    }
    EXPECT_EQ(hashes.size(), ++n_kinds) << "one picture per precision and kind of scene";
  }
}

TEST(Trainer, ResumeContinuesTheInterruptedRunBitForBit) {
  const TempDir dir;
  const io::Scene train = MakeScene(dir.path(), 8, 0);
  const auto rgb_after = [&](const std::filesystem::path& folder) {
    return TrainedField::Load(folder / "checkpoint.bin")
        ->Render(train.cameras[0], train.frames[0].world_from_cam, {.threads = 1})
        .rgb;
  };
  // Schedules follow step / steps, so the first part of a run of 60 needs the same options as the whole: it
  // is cut by a checkpoint every step and a copy of the one that is there when 60 are done in two goes.
  TrainOptions whole = SmallOptions(60);
  whole.field.bf16_table = whole.field.bf16_network = true;
  TrainOptions part = whole;
  // Independent of `steps`.
  part.schedule = whole.schedule =
      TrainingSchedule{.entry_moments = true, .hold = 1, .first_step_scale = 1, .samples_per_pixel_from = 0};
  part.steps = 25;
  const auto straight = dir.path() / "straight", resumed = dir.path() / "resumed";
  std::filesystem::create_directories(straight);
  std::filesystem::create_directories(resumed);
  Train(train, {}, whole, straight);
  Train(train, {}, part, resumed);
  const TrainReport second = Train(train, {}, whole, resumed);
  ASSERT_FALSE(second.events.empty());
  EXPECT_NE(second.events[0].find("resumed at step 25"), std::string::npos);
  EXPECT_EQ(rgb_after(straight), rgb_after(resumed));
}

TEST(Trainer, PicturesHaveTheRaysPerPixelOfTraining) {
  const TempDir dir;
  for (const bool opaque : {false, true}) {
    const auto folder = dir.path() / (opaque ? "opaque" : "alpha");
    std::filesystem::create_directories(folder);
    const io::Scene train = MakeScene(folder, 8, 0, opaque ? Behind::kRoom : Behind::kNothing);
    TrainOptions options = SmallOptions(60);
    options.schedule = TrainingSchedule{.samples_per_pixel_from = 0.9};
    Train(train, {}, options, folder);
    const auto field = TrainedField::Load(folder / "checkpoint.bin");
    const auto rgb = [&](int samples_per_pixel, float step_scale) {
      const RenderOptions render{
          .threads = 1, .step_scale = step_scale, .samples_per_pixel = samples_per_pixel};
      return field->Render(train.cameras[0], train.frames[0].world_from_cam, render).rgb;
    };
    EXPECT_EQ(rgb(0, 0), opaque ? rgb(1, 0.5f) : rgb(4, 0.7f)) << "several rays are for bounded scenes";
    EXPECT_NE(rgb(1, 0.5f), rgb(4, 0.7f));
  }
}

}  // namespace
}  // namespace nerf
