// The page that plays a scene, opened from disk in a browser: it shows what TrainedField renders, and hands
// move it.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/image/image.h"
#include "nerf/fields/checkpoint.h"
#include "nerf/rendering/trained_field.h"
#include "nerf/training/trainer.h"
#include "pipeline/film/camera_path_file.h"
#include "pipeline/film/film.h"
#include "pipeline/page/page_export.h"
#include "tests/support/files/small_run.h"
#include "tests/support/programs/browser.h"
#include "tests/support/programs/require_program.h"
#include "tests/support/scenes/ball_scene.h"
#include "tests/support/scenes/small_mlp.h"
#include "tests/support/scenes/some_splats.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using tests::Behind;

constexpr char kStarted[] = "renderer && home";
constexpr int kWidth = 72, kHeight = 56;

// A field trained for some steps, and its page.
class Played {
 public:
  explicit Played(Behind behind)
      : scene_(tests::BallScene(dir_ / "scene", 16, 0, {.size = 64, .behind = behind})) {
    nerf::TrainOptions options;
    options.steps = 300;
    options.samples_per_step = 4096;
    options.field.log2_hashmap_size = 12;  // most levels are hashed
    options.field.finest_resolution = 128;
    options.field.grid_resolution = 64;
    fs::create_directories(dir_ / "train");
    nerf::Train(scene_, {}, options, dir_ / "train");
    MakeSharesDiffer(dir_ / "train/checkpoint.bin");
    ExportPage(scene_, dir_ / "train/checkpoint.bin", "a </script> run", page());
  }

  // The splats have most of one half of the room and little of the other; in the upper half they lie so far
  // behind the field that it gives way to them.
  static void MakeSharesDiffer(const fs::path& checkpoint) {
    nerf::TrainState state;
    const auto scene_field = nerf::ReadCheckpoint(checkpoint, &state);
    nerf::Splats& splats = scene_field->splats;
    if (splats.size() == 0) return;
    scene_field->splat_share_behind = 1;
    std::vector<std::uint8_t>& shares = scene_field->splat_shares.cells;
    shares.assign(nerf::ShareMap::kCells, 26);
    std::fill_n(shares.begin(), nerf::ShareMap::kCells / 2, std::uint8_t{230});
    for (std::size_t i = 0; i < splats.places.size(); ++i)
      if (splats.places[i / 3 * 3 + 2] > 1) splats.places[i] *= 1.5f;
    nerf::WriteCheckpoint(checkpoint, scene_field.get(), state);
  }

  fs::path page() const { return dir_ / "scene.html"; }
  std::string Url() const { return "file://" + page().string() + "#size=96x72"; }

  const io::Rigid3d& FirstPose() const { return scene_.frames[1].world_from_cam; }

  io::Image Snapshot(Browser* browser, const io::Camera& camera, const io::Rigid3d& pose) const {
    const io::Json asked = {{"pose", RowsOf(pose)},
                            {"width", camera.width},
                            {"height", camera.height},
                            {"focal", {camera.fl_x, camera.fl_y}},
                            {"centre", {camera.cx, camera.cy}}};
    const std::string address = browser->Evaluate("snapshot(" + io::DumpJson(asked) + ")");
    WriteText(dir_ / "page.png", FromBase64(address.substr(address.find(',') + 1)));
    return io::ReadImage(dir_ / "page.png");
  }

  // Of the page's picture against that of the field, both at their finest, with a camera whose axis is not in
  // the middle.
  double Psnr(Browser* browser) const {
    const io::Camera camera = {
        .width = kWidth, .height = kHeight, .fl_x = 80, .fl_y = 84, .cx = 34, .cy = 29.5};
    const io::Rigid3d& pose = FirstPose();
    const io::Image page = Snapshot(browser, camera, pose);
    const auto field = nerf::TrainedField::Load(dir_ / "train/checkpoint.bin");
    const nerf::RenderedView view = field->Render(camera, pose, {});
    double sum = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (int c = 0; c < 3; ++c) {
          const double want = view.rgb[static_cast<std::size_t>(3 * (y * kWidth + x) + c)];
          sum += std::pow(page.Pixel(x, y)[c] / 255.0 - want, 2);
        }
      }
    }
    return -10 * std::log10(sum / (3 * kWidth * kHeight));
  }

 private:
  const TempDir dir_;
  const io::Scene scene_;
};

TEST(PageExport, ShowsABoundedFieldAsItRenders) {
  REQUIRE_PROGRAM("chromium");
  const Played played(Behind::kNothing);
  Browser browser(played.Url());
  ASSERT_TRUE(browser.Becomes(kStarted)) << browser.Evaluate("document.body.innerText");
  EXPECT_EQ(browser.Evaluate("document.title"), "a </script> run");
  EXPECT_GT(played.Psnr(&browser), 45);

  ASSERT_TRUE(browser.Becomes("sharpness === 2 && !refreshing"));
  const auto places = [&] { return io::DumpJson(browser.Evaluate("[view.at, reach()]")); };
  const std::string first = places();
  browser.Drag(40, 36, 70, 40);
  EXPECT_NE(places(), first);
  browser.Wheel(48, 36, 300);
  EXPECT_TRUE(browser.Becomes("reach() > 1.2 * Math.hypot(...add(home.at, scene.focus, -1))"));
  browser.Evaluate("location.hash = ''");  // with the panel again
  browser.Evaluate("byId('home').click()");
  EXPECT_EQ(places(), first);
}

TEST(PageExport, ShowsAnUnboundedFieldAsItRenders) {
  REQUIRE_PROGRAM("chromium");
  const Played played(Behind::kRoom);
  Browser browser(played.Url());
  ASSERT_TRUE(browser.Becomes(kStarted)) << browser.Evaluate("document.body.innerText");
  EXPECT_GT(browser.Evaluate("renderer.splats.n").get<int>(), 1000);
  EXPECT_GT(played.Psnr(&browser), 45);
  // From behind the walls, away from them, there is nothing that a photo showed.
  io::Rigid3d behind = played.FirstPose();
  behind.translation *= 5;
  behind.rotation.col(0) *= -1, behind.rotation.col(2) *= -1;
  const io::Camera camera = {.width = 24, .height = 16, .fl_x = 20, .fl_y = 20, .cx = 12, .cy = 8};
  const io::Image veiled = played.Snapshot(&browser, camera, behind);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(veiled.Pixel(12, 8)[c], 255 * kUnseenTone[static_cast<std::size_t>(c)], 1) << c;
  // Where a picture of splats takes long, none is waited for while a hand moves.
  for (const char* quick : {"false", "true"}) {
    const std::string value = quick;
    browser.Evaluate("Object.defineProperty(renderer.splats, 'areQuick', { value: " + value +
                     ", configurable: true }), moved()");
    EXPECT_TRUE(browser.Becomes("!dirty && sharpness > 0 && renderer.isMixed === " + value)) << value;
  }
}

// The comparisons above would notice.
TEST(PageExport, BrokenShadersLookDifferent) {
  REQUIRE_PROGRAM("chromium");
  struct Fault {
    const char *right, *wrong;
  };
  const std::pair<Behind, std::vector<Fault>> cases[] = {
      {Behind::kNothing,
       {// A corner's weight no longer belongs to the corner.
        {"mix(1.0 - f, f, upper)", "mix(1.0 - f, f, upper.yxz)"}}},
      {Behind::kRoom,
       {// Splats' red is blue.
        {"k0 = mean.yzw", "k0 = mean.wzy"},
        // Their shares are those of other places.
        {"place.zyx", "place.xyz"},
        // They are half as far away, before what hides them.
        {"inverse_distance = 1.0", "inverse_distance = 2.0"}}}};
  for (const auto& [behind, faults] : cases) {
    const Played played(behind);
    const std::string page = io::ReadFile(played.page());
    for (const auto& [right, wrong] : faults) {
      const std::size_t at = page.find(right);
      ASSERT_NE(at, std::string::npos) << right;
      std::string broken = page;
      broken.replace(at, std::string(right).size(), wrong);
      io::WriteFileAtomically(played.page(), broken);
      Browser browser(played.Url());
      ASSERT_TRUE(browser.Becomes(kStarted)) << browser.Evaluate("document.body.innerText");
      EXPECT_LT(played.Psnr(&browser), 35) << wrong;
    }
  }
}

TEST(PageExport, RefusesAFieldThatNoBrowserShows) {
  const TempDir dir;
  const io::Scene scene = tests::SmallBall(dir / "scene", 4, 0, tests::kPrunedFar);
  fs::create_directories(dir / "train");
  nerf::Train(scene, {}, tests::SmallMlp(1, 16), dir / "train");
  try {
    ExportPage(scene, dir / "train/checkpoint.bin", "a run", dir / "scene.html");
    FAIL() << "no error";
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find("hash"), std::string::npos);
  }
  EXPECT_FALSE(fs::exists(dir / "scene.html"));
}

TEST(PageExport, LeavesSplatsOutBeforeItIsTooLarge) {
  const tests::SmallRun run;
  run.Train("train");
  const fs::path checkpoint = run.path() / "train/checkpoint.bin", page = run.path() / "scene.html";
  nerf::TrainState state;
  const std::unique_ptr<nerf::SceneField> field = nerf::ReadCheckpoint(checkpoint, &state);
  const auto page_bytes = [&](std::size_t n_splats, std::size_t max_bytes) {
    field->splats = tests::SomeSplats(n_splats);
    nerf::WriteCheckpoint(checkpoint, field.get(), state);
    return ExportPage(run.scene(), checkpoint, "a run", page, max_bytes);
  };
  const std::size_t alone = page_bytes(0, kMaxPageBytes), with_splats = page_bytes(100, kMaxPageBytes);
  EXPECT_GT(with_splats, alone);
  EXPECT_EQ(page_bytes(100, with_splats), with_splats);
  EXPECT_EQ(page_bytes(100, with_splats - 1), alone);
  EXPECT_EQ(page_bytes(100, alone), alone);
  fs::remove(page);
  EXPECT_ERROR(page_bytes(100, alone - 1), io::ExitCode::kBadInput, "that phones open");
  EXPECT_FALSE(fs::exists(page));
}

}  // namespace
}  // namespace pipeline
