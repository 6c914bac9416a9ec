// Passers-by painted over views of a ball in a room: what is found of them, and what a training makes of
// them.
#include "nerf/training/transients.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/image/image.h"
#include "nerf/data/capture_geometry.h"
#include "nerf/training/heldout_monitor.h"
#include "nerf/training/trainer.h"
#include "nerf/training/transient_masks.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"
#include "tests/support/scenes/passers_by.h"

namespace nerf {
namespace {

constexpr int kSide = 48, kViews = 32;
constexpr tests::BallSceneOptions kRoom{.size = kSide, .behind = tests::Behind::kRoom};

TrainOptions RoomOptions(int steps) {
  TrainOptions options;
  options.steps = steps;
  options.splats = false;
  options.samples_per_step = 8192;
  options.threads = 2;
  options.field.log2_hashmap_size = 12;
  options.field.finest_resolution = 64;
  options.field.grid_resolution = 64;
  return options;
}

constexpr tests::PasserBy kWalker{14, 10, 10, 26};

// A field that was trained on pictures without passers-by.
class Transients : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = std::make_unique<TempDir>();
    scene_ = tests::BallScene(dir_->path(), kViews, 0, kRoom);
    Train(scene_, {}, RoomOptions(400), dir_->path());
  }
  static void TearDownTestSuite() { dir_.reset(); }

  Transients() : dataset_(LoadDataset(scene_, 2)) {
    scene_field_ = ReadCheckpoint(*dir_ / "checkpoint.bin", &state_);
  }

  std::uint8_t* Picture(std::size_t view) { return &dataset_.pixels[3 * dataset_.views[view].first_pixel]; }
  std::vector<std::uint8_t> Find(const std::vector<bool>& used = {}, int threads = 2) {
    io::Workers workers(threads);
    return FindTransients(scene_, PosesOf(scene_), dataset_, used, 2, *scene_field_, &workers);
  }

  static inline std::unique_ptr<TempDir> dir_;
  static inline io::Scene scene_;
  Dataset dataset_;
  TrainState state_;
  std::unique_ptr<SceneField> scene_field_;
};

TEST_F(Transients, AreNotInPicturesWithoutAny) { EXPECT_TRUE(Find().empty()); }

TEST_F(Transients, AreFoundWhereTheyAreAndNowhereElse) {
  ASSERT_EQ(TransientCamera(scene_, 0).width, kSide) << "small pictures are no larger than the pictures";
  for (const std::size_t view : {3u, 4u, 17u}) Paint(kWalker, kSide, 3, Picture(view));
  const std::vector<std::uint8_t> shown = Find();
  ASSERT_EQ(shown.size(), dataset_.n_pixels());
  const tests::PasserBy around{kWalker.x - 4, kWalker.y - 4, kWalker.width + 8, kWalker.height + 8};
  for (std::size_t view = 0; view < kViews; ++view) {
    int found = 0, beside = 0;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const int pixel = shown[dataset_.views[view].first_pixel + static_cast<std::size_t>(y * kSide + x)];
        found += pixel == 1 && kWalker.Covers(x, y);
        beside += pixel == 1 && !around.Covers(x, y);
      }
    }
    const bool has_walker = view == 3 || view == 4 || view == 17;
    EXPECT_EQ(found, has_walker ? kWalker.width * kWalker.height : 0) << view;
    EXPECT_EQ(beside, 0) << view;
  }
  EXPECT_EQ(Find({}, 1), shown) << "threads do not matter";
}

TEST_F(Transients, AreNoShadowsNorTints) {
  for (int i = 0; i < kWalker.width * kWalker.height; ++i) {
    const int pixel = (kWalker.y + i / kWalker.width) * kSide + kWalker.x + i % kWalker.width;
    for (int c = 0; c < 3; ++c)
      Picture(5)[3 * pixel + c] = static_cast<std::uint8_t>(Picture(5)[3 * pixel + c] / 2);
  }
  for (int i = 0; i < 3 * kSide * kSide; ++i)
    Picture(9)[i] = static_cast<std::uint8_t>(std::min(255, Picture(9)[i] + 60));
  EXPECT_TRUE(Find().empty());
}

TEST_F(Transients, AreNotLookedForWherePicturesAreNotUsed) {
  Paint(kWalker, kSide, 3, Picture(3));
  std::vector<bool> used(dataset_.n_pixels(), true);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x)
      used[dataset_.views[3].first_pixel + static_cast<std::size_t>(y * kSide + x)] = !kWalker.Covers(x, y);
  }
  EXPECT_TRUE(Find(used).empty());
}

TEST(TransientMasks, KeepThemOutOfATraining) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), kViews, 0, kRoom),
                  heldout = tests::BallScene(dir.path(), 4, 0.37, kRoom);
  tests::PaintPassersBy(scene);
  TrainOptions options = RoomOptions(600);
  std::vector<double> psnr;
  for (const bool find : {false, true}) {
    options.find_transients = find;
    const auto folder = dir / std::to_string(find);
    std::filesystem::create_directories(folder);
    const TrainReport report = Train(scene, heldout, options, folder);
    psnr.push_back(report.heldout_psnr);
    ASSERT_EQ(report.masks.size(), find ? scene.frames.size() : 0);
    std::size_t n_found = 0;
    for (std::size_t view = 0; view < report.masks.size(); ++view) {
      n_found += !report.masks[view].used.empty();
      EXPECT_TRUE(report.masks[view].used.empty() || view % 3 == 0) << view;
    }
    EXPECT_GE(n_found, find ? 7u : 0u) << "of 11";
  }
  EXPECT_GT(psnr[1], psnr[0] + 2);
}

TEST(TransientMasks, ThreadsAndInterruptionsDoNotMatter) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), kViews, 0, kRoom);
  tests::PaintPassersBy(scene);
  const TrainOptions options = RoomOptions(300);
  constexpr std::uint64_t kSteps = TransientMasks::kFirstLook + 20;
  std::vector<TrainState> states(2);
  std::vector<std::vector<float>> densities;
  for (const int threads : {1, 3}) {
    io::Workers workers(threads);
    TrainState& state = states[densities.size()];
    TrainReport report;
    Dataset dataset;
    std::optional<TransientMasks> masks;
    std::optional<FieldFit> fit;
    const auto begin = [&](std::unique_ptr<SceneField> field) {
      dataset = LoadDataset(scene, threads);
      fit.emplace(scene, options, std::move(field), &dataset, &state, &report, &workers);
      masks.emplace(scene, &dataset, &state, &workers);
    };
    begin(nullptr);
    while (state.step < kSteps) {
      masks->BeforeStep(*fit);
      fit->Step(static_cast<double>(state.step) / kSteps);
      if (threads == 1 || state.step != TransientMasks::kFirstLook + 5) continue;
      WriteCheckpoint(dir / "cut.bin", fit->scene_field(), state);
      state = {};
      begin(ReadCheckpoint(dir / "cut.bin", &state));
    }
    EXPECT_LT(dataset.n_used(), dataset.n_pixels());
    densities.emplace_back(fit->scene_field()->grid.density().begin(),
                           fit->scene_field()->grid.density().end());
  }
  EXPECT_EQ(states[0].transients.last_look, TransientMasks::kFirstLook);
  EXPECT_EQ(states[1].transients.last_look, TransientMasks::kFirstLook);
  EXPECT_EQ(states[0].transients.shown, states[1].transients.shown);
  EXPECT_EQ(states[0].squared_error, states[1].squared_error);
  EXPECT_EQ(densities[0], densities[1]);
}

TEST(TransientMasks, OfOtherPicturesAreRefused) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), 8, 0, kRoom);
  Dataset dataset = LoadDataset(scene, 1);
  io::Workers workers(1);
  TrainState state;
  state.transients = {.shown = std::vector<std::uint8_t>(100, 1), .last_look = 150};
  EXPECT_THROW(TransientMasks(scene, &dataset, &state, &workers), io::Error);
}

}  // namespace
}  // namespace nerf
