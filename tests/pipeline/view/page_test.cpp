// The page in a browser: it shows the scene, and mouse, keys, photos and the camera path do what they say.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/image/image.h"
#include "pipeline/film/camera_path_file.h"
#include "pipeline/view/view_server.h"
#include "tests/support/files/small_run.h"
#include "tests/support/programs/browser.h"
#include "tests/support/programs/require_program.h"

namespace pipeline {
namespace {

constexpr char kSharp[] = "view && level === 2 && !refreshing";
constexpr double kX = 300, kY = 350;  // in the picture's middle

TEST(ViewPage, IsDrivenByMouseKeysAndButtons) {
  REQUIRE_PROGRAM("chromium");
  const tests::SmallRun small;
  small.Train("train");
  LiveRun run(small.path(), 2);
  FrameMaker maker(2, 0.2);
  const ViewServer server(&run, &maker, {});
  Browser browser(server.Url());
  ASSERT_TRUE(browser.Becomes(kSharp)) << browser.Evaluate("document.body.innerText");
  EXPECT_EQ(browser.Evaluate("byId('name').textContent"), "a run");

  const auto places = [&] { return io::DumpJson(browser.Evaluate("[view.at, reach()]")); };
  const std::string first = places();
  const double reach = browser.Evaluate("reach()");
  browser.Drag(kX, kY, kX + 80, kY + 20);
  EXPECT_NE(places(), first);
  EXPECT_NEAR(browser.Evaluate("reach()").get<double>(), reach, 1e-6 * reach);  // turned around the pivot
  browser.Wheel(kX, kY, 300);
  EXPECT_TRUE(browser.Becomes("reach() > " + std::to_string(1.2 * reach)));
  const std::string before_key = places();
  browser.Key("w", "keyDown");
  EXPECT_TRUE(browser.Becomes("JSON.stringify([view.at, reach()]) !== '" + before_key + "'"));
  browser.Key("w", "keyUp");
  EXPECT_TRUE(browser.Becomes(kSharp));
  browser.Evaluate("byId('home').click()");
  EXPECT_EQ(places(), first);

  browser.Evaluate("byId('cameras').click(), showPhoto(3)");
  EXPECT_TRUE(browser.Becomes("photo && !byId('compare').hidden"));
  ASSERT_TRUE(browser.Becomes(kSharp));
  browser.Screenshot(small.path() / "screen.png");
  const io::Image screen = io::ReadImage(small.path() / "screen.png");
  EXPECT_EQ(screen.width, 1000);
  // Left of the slider the photograph's ball, right of it the rendered one.
  for (const int x : {static_cast<int>(kX), static_cast<int>(kX) + 90}) {
    const std::uint8_t* pixel = screen.Pixel(x, static_cast<int>(kY));
    EXPECT_GT(pixel[0] + pixel[1] + pixel[2], 60) << x;
  }

  for (const int photo : {0, 2})
    browser.Evaluate("leavePhoto(), show(viewOf(scene.cameras[" + std::to_string(photo) + "])), addKey()");
  EXPECT_EQ(browser.Evaluate("byId('keys').children.length"), 2);
  browser.Evaluate("byId('seconds').value = 1, byId('save').click()");
  EXPECT_TRUE(browser.Becomes("byId('saved').textContent.startsWith('Saved')"));
  const CameraPathFile path = ReadCameraPath(small.path() / "camera_path.json");
  ASSERT_EQ(path.frames.size(), 30u);
  EXPECT_LT(
      (path.frames[0].world_from_cam.translation - small.scene().frames[0].world_from_cam.translation).norm(),
      1e-9);
  // A box around a part of the ball that lies left of the middle: the rest goes, and the box is kept.
  EXPECT_FALSE(path.crop);
  browser.Evaluate("show(home), byId('crop').click(), moveSide(1, -0.2), moved()");
  ASSERT_TRUE(browser.Becomes(kSharp));
  browser.Screenshot(small.path() / "cropped.png");
  const io::Image cropped = io::ReadImage(small.path() / "cropped.png");
  const auto brightness = [&](const io::Image& image, int x) {
    const std::uint8_t* pixel = image.Pixel(x, static_cast<int>(kY));
    return pixel[0] + pixel[1] + pixel[2];
  };
  EXPECT_LT(brightness(cropped, static_cast<int>(kX) + 90), 90);
  EXPECT_GT(brightness(cropped, static_cast<int>(kX) - 90), 90);
  browser.Evaluate("byId('saved').textContent = '', byId('save').click()");
  EXPECT_TRUE(browser.Becomes("byId('saved').textContent.startsWith('Saved')"));
  const Crop crop = ReadCrop(small.path() / "camera_path.json");
  EXPECT_NEAR(browser.Evaluate("placeOf(1)").get<double>(), -0.2, 1e-9);
  browser.Evaluate("box = null, loadPath()");
  EXPECT_TRUE(browser.Becomes("box && Math.abs(placeOf(1) + 0.2) < 1e-9"));
  EXPECT_NEAR(browser.Evaluate("box.size[1]").get<double>(), crop.box.size[1], 1e-9);
  browser.Evaluate("byId('crop').click()");

  browser.Evaluate("play()");
  EXPECT_TRUE(browser.Becomes("path === null"))
      << browser.Evaluate("[path && path.length, dirty, refreshing, level, document.hidden]");
  EXPECT_EQ(browser.Evaluate("byId('fault').hidden"), true);
}

}  // namespace
}  // namespace pipeline
