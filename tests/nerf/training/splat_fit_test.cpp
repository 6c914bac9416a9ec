// Splats seeded on a trained field and fitted to its pictures: better pictures, and the same bytes again.
#include "nerf/training/splat_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "io/base/error.h"
#include "io/image/image.h"
#include "nerf/data/capture_geometry.h"
#include "nerf/rendering/splat_mixing.h"
#include "nerf/rendering/trained_field.h"
#include "nerf/training/field_surface.h"
#include "nerf/training/heldout_monitor.h"
#include "nerf/training/splat_shares.h"
#include "nerf/training/trainer.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/ball_scene.h"
#include "tests/support/scenes/small_training.h"

namespace nerf {
namespace {

TrainOptions FitOptions(int steps, bool splats = true) {
  TrainOptions options = tests::SmallTraining(steps);
  options.splats = splats;
  return options;
}

// A ball in a room, and a field that was trained on it without splats.
class SplatFits : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = std::make_unique<TempDir>();
    const tests::BallSceneOptions room{.size = 48, .behind = tests::Behind::kRoom};
    scene_ = tests::BallScene(dir_->path(), 32, 0, room);
    heldout_ = tests::BallScene(dir_->path(), 4, 0.37, room);
    Train(scene_, {}, FitOptions(600, false), dir_->path());
  }
  static void TearDownTestSuite() { dir_.reset(); }

  SplatFits() : dataset_(LoadDataset(scene_, 2)) {
    scene_field_ = ReadCheckpoint(*dir_ / "checkpoint.bin", &state_);
  }

  SplatFit Fit(io::Workers* workers) {
    return SplatFit(scene_, dataset_, PosesOf(scene_), scene_field_.get(), &state_, workers);
  }

  static inline std::unique_ptr<TempDir> dir_;
  static inline io::Scene scene_, heldout_;
  Dataset dataset_;
  TrainState state_;
  std::unique_ptr<SceneField> scene_field_;
  io::Workers workers_{2};
  SplatRasteriser rasteriser_{&workers_};
};

TEST_F(SplatFits, SurfacePointsLieOnTheBallAndOnTheWalls) {
  const std::vector<SurfacePoint> points = FieldSurface(*scene_field_, dataset_, 500, 1, &workers_);
  ASSERT_EQ(points.size(), 500u);
  int n_ball = 0, n_upright = 0;
  for (const SurfacePoint& point : points) {
    EXPECT_NEAR(point.normal.norm(), 1, 1e-5);
    EXPECT_GT(point.footprint, 0);
    if (std::abs(point.position.norm() - 0.8f) > 0.1f) continue;
    ++n_ball;
    n_upright += point.normal.dot(point.position.normalized()) > 0.7f;
  }
  EXPECT_GT(n_ball, 60);  // it covers a fifth of the pictures
  EXPECT_GT(n_upright, n_ball * 6 / 10);
}

// Grey pictures whose left quarter is a chequerboard: half of the points and a quarter of the others lie
// there.
TEST_F(SplatFits, HalfOfTheSurfacePointsLieWherePicturesChange) {
  for (std::size_t i = 0; i < dataset_.pixels.size(); ++i) {
    const std::size_t x = i / 3 % 48, y = i / 3 / 48;
    dataset_.pixels[i] = x >= 12 ? 128 : (x / 2 + y / 2) % 2 == 0 ? 255 : 0;
  }
  const std::vector<SurfacePoint> points = FieldSurface(*scene_field_, dataset_, 2000, 1, &workers_);
  const auto n_grey = std::count_if(points.begin(), points.end(), [](const SurfacePoint& point) {
    return std::abs(point.rgb.x() - 128 / 255.f) < 0.01f;
  });
  EXPECT_NEAR(static_cast<double>(n_grey) / 2000, 0.5 * 0.75, 0.06);
}

TEST_F(SplatFits, AreNotFinishedWithAValueThatIsNotFinite) {
  SplatFit fit = Fit(&workers_);
  fit.Step(0);
  scene_field_->splats.log_scales[7] = std::numeric_limits<float>::quiet_NaN();
  fit.Step(0.9);  // no picture shows that splat
  EXPECT_ERROR(fit.Finish(), io::ExitCode::kNumeric, "a value is not finite");
}

auto EventsWith(const TrainReport& report, const std::string& beginning) {
  return std::count_if(report.events.begin(), report.events.end(), [&](const std::string& event) {
    return event.starts_with(beginning);
  });
}

TEST(Training, FindsTheSkyOfItsPictures) {
  const TempDir dir;
  io::Image picture = io::MakeImage(48, 36, 3);
  for (int y = 0; y < 36; ++y) {
    for (int x = 0; x < 48; ++x) {
      const int level = (x / 3 + y / 3) % 2 == 0 ? 90 : 150;
      const std::array<int, 3> rgb = y < 14 ? std::array{90 + y, 130 + y, 200} : std::array{level, level, 60};
      std::copy(rgb.begin(), rgb.end(), picture.Pixel(x, y));
    }
  }
  io::Scene scene;
  scene.cameras = {{.width = 48, .height = 36, .fl_x = 40, .fl_y = 40, .cx = 24, .cy = 18}};
  for (int i = 0; i < 3; ++i) {
    io::Frame frame{.image_path = dir / ("view" + std::to_string(i) + ".png")};
    frame.world_from_cam.translation = {static_cast<double>(i), 0, 4};
    io::WriteImage(frame.image_path, picture);
    scene.frames.push_back(frame);
  }
  const TrainReport report = Train(scene, {}, FitOptions(2, false), dir.path());
  EXPECT_EQ(EventsWith(report, "the pictures show the sky in 39 %"), 1);  // 14 of 36 rows
}

TEST(Training, EvensOutTheBrightnessOfPictures) {
  const TempDir dir;
  io::Scene scene =
      tests::BallScene(dir.path(), 12, 0, {.size = 64, .focal = 2, .behind = tests::Behind::kRoom});
  std::vector<double> brightness;  // of each picture as it was, levels of all its pixels
  for (std::size_t view = 0; view < scene.frames.size(); ++view) {
    io::Image picture = io::ReadImage(scene.frames[view].image_path);
    const int percent = 60 + static_cast<int>(view * 17 % 40);
    brightness.push_back(0);
    for (std::size_t i = 0; i < picture.data.size(); ++i) {
      if (i % 4 == 3) continue;  // alpha
      brightness.back() += picture.data[i];
      picture.data[i] = static_cast<std::uint8_t>(picture.data[i] * percent / 100);
    }
    io::WriteImage(scene.frames[view].image_path, picture);
  }
  for (int i = 0; i < 600; ++i) {  // on the ball, evenly (Fibonacci's spiral)
    const double z = 1 - (2 * i + 1) / 600., turn = 2.39996 * i, r = std::sqrt(1 - z * z);
    io::Point3D point{.xyz = {0.8 * r * std::cos(turn), 0.8 * r * std::sin(turn), 0.8 * z}};
    for (std::size_t view = 0; view < scene.frames.size(); ++view) {
      const Eigen::Vector3d to_camera = scene.frames[view].world_from_cam.translation - point.xyz;
      if (to_camera.dot(point.xyz) > 0.4 * to_camera.norm())
        point.frame_indices.push_back(static_cast<int>(view));
    }
    scene.points.push_back(point);
  }
  const TrainReport report = Train(scene, {}, FitOptions(300, false), dir.path());
  EXPECT_EQ(EventsWith(report, "brightness and tint change by 1"), 1)
      << testing::PrintToString(report.events);
  const auto field = TrainedField::Load(dir / "checkpoint.bin");
  std::vector<double> shares;
  for (std::size_t view = 0; view < scene.frames.size(); ++view) {
    const RenderedView shown = field->Render(scene.cameras[0], scene.frames[view].world_from_cam, {});
    shares.push_back(std::accumulate(shown.rgb.begin(), shown.rgb.end(), 0.0) / brightness[view]);
  }
  const auto [least, most] = std::minmax_element(shares.begin(), shares.end());
  EXPECT_LT(*most, 1.2 * *least) << "pictures as they are have 1.6";
}

TEST_F(SplatFits, LeaveTheSkyToTheField) {
  const std::size_t n_all = FieldSurface(*scene_field_, dataset_, 500, 1, &workers_).size();
  for (std::size_t i = 0; i < dataset_.n_pixels(); ++i) dataset_.sky.push_back(i / 48 % 48 < 16);
  const std::size_t n = FieldSurface(*scene_field_, dataset_, 500, 1, &workers_).size();
  EXPECT_LT(n, 0.8 * static_cast<double>(n_all));
  EXPECT_GT(n, 0.5 * static_cast<double>(n_all));

  SplatFit fit = Fit(&workers_);
  for (int i = 0; i < 250; ++i) fit.Step(i / 250.0);
  const SplatPicture picture =
      RenderSplats(*scene_field_, scene_.cameras[0], scene_.frames[0].world_from_cam, {}, &rasteriser_);
  const auto middle = picture.transmittance.begin() + 16 * 48;
  // Not all of it: other views show some of these walls lower in their pictures.
  EXPECT_GT(std::accumulate(picture.transmittance.begin(), middle, 0.f) / (16 * 48), 0.6f);
  EXPECT_LT(std::accumulate(middle, picture.transmittance.end(), 0.f) / (32 * 48), 0.3f);
}

TEST_F(SplatFits, MakeHeldOutPicturesBetter) {
  const HeldoutMonitor monitor(heldout_, 2, 0.5);
  const double before = monitor.Psnr(*scene_field_, &workers_);
  SplatFit fit = Fit(&workers_);
  EXPECT_EQ(scene_field_->splats.size(), SplatFit::Number(dataset_.n_used()));
  // A short fit leaves splats that are worse than the field, and counts them accordingly.
  for (int i = 0; i < 40; ++i) fit.Step(i / 400.0);
  EXPECT_LT(scene_field_->splat_share, 0.1f);
  EXPECT_GT(monitor.Psnr(*scene_field_, &workers_), before - 0.3);
  for (int i = 40; i < 400; ++i) fit.Step(i / 400.0);
  EXPECT_EQ(state_.splats.step, 400u);
  EXPECT_TRUE(state_.splats.is_judged);
  const std::string text = fit.Finish();
  EXPECT_NE(text.find("4 pictures that were set aside"), std::string::npos) << text;
  EXPECT_GT(scene_field_->splats.size(), 0u);
  EXPECT_FALSE(scene_field_->splat_shares.empty());
  EXPECT_TRUE(state_.splats.moments.empty());
  EXPECT_GT(monitor.Psnr(*scene_field_, &workers_), before + 0.5);
  EXPECT_GT(scene_field_->splat_share, 0.2f);

  // The monitor's picture is that of the trained field.
  WriteCheckpoint(*dir_ / "fitted.bin", scene_field_.get(), state_);
  const auto field = TrainedField::Load(*dir_ / "fitted.bin");
  const auto render = [&](bool splats) {
    return field
        ->Render(heldout_.cameras[0],
                 heldout_.frames[0].world_from_cam,
                 {.threads = 2, .step_scale = 1, .splats = splats})
        .rgb;
  };
  EXPECT_NE(render(true), render(false));
}

// Where a tenth of the pixels shows them farther away than the field, it is the splats that have holes.
TEST_F(SplatFits, AreBelievedBehindTheFieldWhereItSeldomStandsBeforeThem) {
  for (const bool has_holes : {false, true}) {
    SplatFit fit = Fit(&workers_);
    for (int i = 0; i < 20; ++i) fit.Step(i / 20.0);
    scene_field_->splat_share = 0.5f;
    // Those of the ball let the walls through.
    for (std::size_t i = 0; has_holes && i < scene_field_->splats.size(); ++i) {
      float* place = &scene_field_->splats.places[3 * i];
      if (std::hypot(place[0], place[1], place[2]) < 1) scene_field_->splats.opacities[i] = -20;
    }
    const std::string text = fit.Finish();
    if (has_holes) {
      EXPECT_EQ(scene_field_->splat_share_behind, 0) << text;
    } else {
      EXPECT_GT(scene_field_->splat_share_behind, 0.6) << text;
    }
    state_ = {}, scene_field_ = ReadCheckpoint(*dir_ / "checkpoint.bin", &state_);
  }
}

// Splats of one half of the room are too bright.
TEST_F(SplatFits, CountForMoreWhereTheyAreBetter) {
  SplatFit fit = Fit(&workers_);
  for (int i = 0; i < 100; ++i) fit.Step(i / 100.0);
  scene_field_->splat_share = 0.5f;
  const Splats good = scene_field_->splats;
  const SplatPhotos photos(scene_, dataset_, PosesOf(scene_), *scene_field_);
  // Often enough for all of their pixels.
  std::vector<std::size_t> views;
  for (std::size_t i = 0; i < 63; ++i) views.push_back(i % 7);
  const auto is_bright = [&](std::size_t i) { return good.places[3 * i] > 0.3f; };
  for (std::size_t i = 0; i < good.size(); ++i) {
    if (!is_bright(i)) continue;
    for (std::size_t c = 0; c < 3; ++c)
      scene_field_->splats.colours[3 * kHarmonics * i + c] += static_cast<float>(0.2 / kHarmonic0);
  }
  const ShareMap shares = SharesByPlace(*scene_field_, photos, views, &workers_);
  ASSERT_EQ(shares.cells.size(), ShareMap::kCells);
  io::Scene seen = scene_;
  seen.frames.resize(7);
  const HeldoutMonitor monitor(seen, 2, 0.5);
  const double alike = monitor.Psnr(*scene_field_, &workers_);
  scene_field_->splat_shares = shares;
  EXPECT_GT(monitor.Psnr(*scene_field_, &workers_), alike + 0.3) << alike;

  io::Workers three(3);
  EXPECT_EQ(SharesByPlace(*scene_field_, photos, views, &three).cells, shares.cells);

  std::ranges::fill(scene_field_->splats.opacities, -20.f);
  EXPECT_TRUE(SharesByPlace(*scene_field_, photos, views, &workers_).empty()) << "the field is all there is";
}

TEST_F(SplatFits, ThreadsAndInterruptionsDoNotMatter) {
  std::vector<Splats> results;
  for (const int threads : {1, 3}) {
    io::Workers workers(threads);
    TrainState state;
    auto field = ReadCheckpoint(*dir_ / "checkpoint.bin", &state);
    std::optional<SplatFit> fit(
        std::in_place, scene_, dataset_, PosesOf(scene_), field.get(), &state, &workers);
    for (int i = 0; i < 10; ++i) {
      // One of them is cut by a checkpoint before and one after the referee.
      if (threads == 3 && (i == 3 || i == 8)) {
        fit.reset();
        WriteCheckpoint(*dir_ / "cut.bin", field.get(), state);
        state = {};
        field = ReadCheckpoint(*dir_ / "cut.bin", &state);
        fit.emplace(scene_, dataset_, PosesOf(scene_), field.get(), &state, &workers);
      }
      fit->Step(i / 10.0);
    }
    results.push_back(field->splats);
  }
  EXPECT_EQ(results[0].places, results[1].places);
  EXPECT_EQ(results[0].log_scales, results[1].log_scales);
  EXPECT_EQ(results[0].rotations, results[1].rotations);
  EXPECT_EQ(results[0].opacities, results[1].opacities);
  EXPECT_EQ(results[0].colours, results[1].colours);
}

// Every picture set aside shows something else than its neighbours do.
TEST_F(SplatFits, ThatLearnThePicturesByHeartCountForNothing) {
  for (std::size_t v = kJudgedEvery / 2; v < dataset_.views.size(); v += kJudgedEvery) {
    const View& view = dataset_.views[v];
    for (std::size_t i = 0; i < 3 * view.n_pixels(); ++i) dataset_.pixels[3 * view.first_pixel + i] ^= 0xff;
  }
  SplatFit fit = Fit(&workers_);
  for (int i = 0; i < 250; ++i) fit.Step(i / 250.0);
  EXPECT_GT(state_.splats.error_ratio, 10);
  EXPECT_LT(scene_field_->splat_share, 0.1f);
  EXPECT_NE(fit.Finish().find("dropped"), std::string::npos);
  EXPECT_EQ(scene_field_->splats.size(), 0u);
  EXPECT_EQ(scene_field_->splat_share_behind, 0);
}

// The error that decides the share is that of used pixels. Half of these have half of the splats, which begin
// elsewhere; counted over all pixels, their error would be about a third.
TEST_F(SplatFits, UnusedPixelsDoNotMakeSplatsLookBetter) {
  SplatFit whole = Fit(&workers_);
  whole.Step(0);
  const double error = state_.splats.squared_error;
  scene_field_ = ReadCheckpoint(*dir_ / "checkpoint.bin", &state_);
  std::vector<PixelRun> runs;  // every other row
  std::uint32_t rank = 0;
  for (std::uint32_t first = 0; first < dataset_.n_pixels(); first += 96, rank += 48)
    runs.push_back({rank, first});
  runs.push_back({rank, static_cast<std::uint32_t>(dataset_.n_pixels())});
  dataset_.runs = PixelRuns(runs);
  SplatFit part = Fit(&workers_);
  part.Step(0);
  EXPECT_NEAR(state_.splats.squared_error, error, 0.45 * error);
}

TEST_F(SplatFits, NeedOpaquePicturesAndEnoughOfThem) {
  EXPECT_TRUE(SplatFit::Suits(dataset_, FieldKind::kHash));
  EXPECT_FALSE(SplatFit::Suits(dataset_, FieldKind::kMlp));
  Dataset few = dataset_, with_alpha = dataset_;
  few.views.erase(few.views.begin() + kJudgedEvery - 1, few.views.end());
  with_alpha.channels = 4;
  EXPECT_FALSE(SplatFit::Suits(few, FieldKind::kHash));
  EXPECT_FALSE(SplatFit::Suits(with_alpha, FieldKind::kHash));
}

}  // namespace
}  // namespace nerf
