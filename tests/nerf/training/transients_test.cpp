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
#include "tests/support/scenes/small_training.h"

namespace nerf {
namespace {

constexpr int kSide = 48, kViews = 32;
constexpr tests::BallSceneOptions kRoom{.size = kSide, .behind = tests::Behind::kRoom};

TrainOptions RoomOptions(int steps) {
  TrainOptions options = tests::SmallTraining(steps);
  options.splats = false;
  return options;
}

constexpr tests::PasserBy kWalker{14, 10, 10, 26};
constexpr int kWalkerPixels = kWalker.width * kWalker.height;

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
    state_.transients = {};
  }

  std::uint8_t* Picture(std::size_t view) { return &dataset_.pixels[3 * dataset_.views[view].first_pixel]; }
  void Brighten(std::size_t view) {
    for (int i = 0; i < 3 * kSide * kSide; ++i)
      Picture(view)[i] = static_cast<std::uint8_t>(std::min(255, Picture(view)[i] + 25));
  }
  std::vector<std::uint8_t> Find(const std::vector<bool>& used = {}, int threads = 2) {
    io::Workers workers(threads);
    return FindTransients(scene_, PosesOf(scene_), dataset_, used, 2, *scene_field_, &workers);
  }

  // Of the pixels that were found in a view, those of kWalker and those farther away than its margin.
  struct Found {
    int walker = 0, beside = 0;
  };
  Found CountIn(const std::vector<std::uint8_t>& shown, std::size_t view) const {
    EXPECT_EQ(shown.size(), dataset_.n_pixels());
    const tests::PasserBy around{kWalker.x - 4, kWalker.y - 4, kWalker.width + 8, kWalker.height + 8};
    Found found;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        if (shown.at(dataset_.views[view].first_pixel + static_cast<std::size_t>(y * kSide + x)) != 1)
          continue;
        found.walker += kWalker.Covers(x, y);
        found.beside += !around.Covers(x, y);
      }
    }
    return found;
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
  for (std::size_t view = 0; view < kViews; ++view) {
    const bool has_walker = view == 3 || view == 4 || view == 17;
    EXPECT_EQ(CountIn(shown, view).walker, has_walker ? kWalkerPixels : 0) << view;
    EXPECT_EQ(CountIn(shown, view).beside, 0) << view;
  }
  EXPECT_EQ(Find({}, 1), shown) << "threads do not matter";
}

TEST_F(Transients, AreFoundInATintedPicture) {
  Brighten(9);
  Paint(kWalker, kSide, 3, Picture(9));
  const std::vector<std::uint8_t> shown = Find();
  EXPECT_EQ(CountIn(shown, 9).walker, kWalkerPixels);
  EXPECT_EQ(CountIn(shown, 9).beside, 0);
}

// Below row 30 all the other views show something else as well.
TEST_F(Transients, GoOnWhereOtherViewsDecideNothing) {
  for (std::size_t view = 0; view < kViews; ++view)
    Paint(view == 3 ? kWalker : tests::PasserBy{0, 30, kSide, kSide - 30}, kSide, 3, Picture(view));
  EXPECT_EQ(CountIn(Find(), 3).walker, kWalkerPixels);
}

TEST_F(Transients, AreNoShadowsNorTints) {
  for (int i = 0; i < kWalker.width * kWalker.height; ++i) {
    const int pixel = (kWalker.y + i / kWalker.width) * kSide + kWalker.x + i % kWalker.width;
    for (int c = 0; c < 3; ++c)
      Picture(5)[3 * pixel + c] = static_cast<std::uint8_t>(Picture(5)[3 * pixel + c] / 2);
  }
  Brighten(9);
  EXPECT_TRUE(Find().empty());
}

// Everything lies two or three pixels beside its place.
TEST_F(Transients, AreNoPicturesOfAWrongPose) {
  std::vector<io::Rigid3d> poses = PosesOf(scene_);
  const double angle = 2.5 / scene_.cameras[0].fl_x;
  poses[3].rotation *= Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
  io::Workers workers(2);
  EXPECT_TRUE(FindTransients(scene_, poses, dataset_, {}, 2, *scene_field_, &workers).empty());
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

TEST_F(Transients, AreLookedForUntilThereIsAlmostNothing) {
  const TrainOptions options = RoomOptions(400);
  io::Workers workers(2);
  TrainReport report;
  FieldFit fit(scene_, options, std::move(scene_field_), &dataset_, &state_, &report, &workers);
  const auto looks = [&] {
    TransientMasks masks(scene_, &dataset_, &state_, &workers);
    std::vector<std::uint64_t> looked;
    for (state_.step = 0; state_.step < 2000; ++state_.step) {
      masks.BeforeStep(fit);
      const std::uint64_t last = state_.transients.last_look;
      if (last > 0 && (looked.empty() || looked.back() != last)) looked.push_back(last);
    }
    state_.transients = {};
    return looked;
  };
  EXPECT_EQ(looks(), (std::vector<std::uint64_t>{150, 450}));
  Paint(kWalker, kSide, 3, Picture(3));
  EXPECT_EQ(looks(), (std::vector<std::uint64_t>{150, 450, 1350}));
}

// Every second view shows one, and little else is used.
TEST_F(Transients, AreNotLeftOutWhereLittleElseWouldBeLeft) {
  std::vector<bool> used;
  for (std::size_t view = 0; view < kViews; ++view) {
    const bool has_walker = view % 2 == 0;
    if (has_walker) Paint(kWalker, kSide, 3, Picture(view));
    const tests::PasserBy kept =
        has_walker ? tests::PasserBy{9, 5, 20, 36} : tests::PasserBy{9, 0, 24, kSide};
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) used.push_back(kept.Covers(x, y));
    }
  }
  const std::vector<std::uint8_t> shown = Find(used);
  const auto n_kept = std::count(used.begin(), used.end(), true);
  ASSERT_GT(std::count(shown.begin(), shown.end(), 1), 0.15 * static_cast<double>(n_kept));

  const TrainOptions options = RoomOptions(400);
  io::Workers workers(2);
  TrainReport report;
  dataset_.Use(used);
  FieldFit fit(scene_, options, std::move(scene_field_), &dataset_, &state_, &report, &workers);
  TransientMasks masks(scene_, &dataset_, &state_, &workers);
  state_.step = TransientMasks::kFirstLook;  // with a wide margin
  masks.BeforeStep(fit);
  EXPECT_EQ(state_.transients.last_look, TransientMasks::kFirstLook);
  EXPECT_TRUE(state_.transients.shown.empty());
  EXPECT_EQ(dataset_.n_used(), static_cast<std::size_t>(n_kept));
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

TEST(TransientMasks, LeaveOutPixelsAndTheirSparseDepths) {
  const TempDir dir;
  const io::Scene scene = tests::BallScene(dir.path(), 3, 0, kRoom);
  Dataset dataset = LoadDataset(scene, 1);
  dataset.depths = {{.view = 1, .point = 0, .x = 20.5f, .y = 20.5f, .t = 4},
                    {.view = 1, .point = 1, .x = 40.5f, .y = 20.5f, .t = 4},
                    {.view = 2, .point = 0, .x = 20.5f, .y = 20.5f, .t = 4}};
  io::Workers workers(1);
  TrainState state;
  state.transients = {.shown = std::vector<std::uint8_t>(dataset.n_pixels(), 0), .last_look = 150};
  for (std::size_t i = 0; i < kSide * kSide; ++i) {
    const int x = static_cast<int>(i) % kSide, y = static_cast<int>(i) / kSide;
    state.transients.shown[dataset.views[1].first_pixel + i] = kWalker.Covers(x, y) ? 1 : 0;
  }
  const TransientMasks masks(scene, &dataset, &state, &workers);
  EXPECT_EQ(dataset.n_used(), dataset.n_pixels() - kWalkerPixels);
  ASSERT_EQ(dataset.depths.size(), 2u);
  EXPECT_EQ(dataset.depths[0].point, 1u);
  EXPECT_EQ(dataset.depths[1].view, 2u);
  ASSERT_EQ(masks.Masks().size(), 3u);
  EXPECT_TRUE(masks.Masks()[0].used.empty());
  EXPECT_EQ(masks.Masks()[1].UsedCount(), static_cast<std::size_t>(kSide * kSide - kWalkerPixels));
  EXPECT_NE(masks.Describe().find("1 of 3"), std::string::npos) << masks.Describe();
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
