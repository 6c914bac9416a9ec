// The sky in pictures that are painted: what is one, what only looks like one, and what stands before it.
#include "nerf/data/sky.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

namespace nerf {
namespace {

using Rgb = std::array<int, 3>;
using Paint = std::function<Rgb(int x, int y)>;

constexpr int kColumns = 128, kRows = 96;
constexpr int kHorizon = kRows / 2, kSkyline = 36;  // rows

// Three cameras side by side that look straight ahead, and see the same picture.
struct Capture {
  explicit Capture(const Paint& paint) {
    scene.cameras = {{.width = kColumns, .height = kRows, .fl_x = 100, .fl_y = 100, .cx = 64, .cy = 48}};
    for (int i = 0; i < 3; ++i) {
      io::Frame frame{.image_path = "view " + std::to_string(i)};
      frame.world_from_cam.translation.x() = i;
      scene.frames.push_back(frame);
      dataset.views.push_back({frame.image_path.string(),
                               RayCamera(scene.cameras[0], frame.world_from_cam),
                               kColumns,
                               kRows,
                               dataset.n_pixels()});
      for (int y = 0; y < kRows; ++y) {
        for (int x = 0; x < kColumns; ++x) {
          for (const int level : paint(x, y)) dataset.pixels.push_back(static_cast<std::uint8_t>(level));
        }
      }
    }
  }

  std::vector<bool> Sky() const {
    io::Workers workers(2);
    return FindSky(scene, dataset, &workers);
  }

  io::Scene scene;
  Dataset dataset;
};

Rgb Ground(int x, int y) { return (x / 3 + y / 3) % 2 == 0 ? Rgb{120, 100, 80} : Rgb{150, 130, 110}; }
Rgb Blue(int x, int y) { return {90 + y, 130 + y, 200 + (x + y) % 3}; }

// `above` as far down as the skyline.
Paint Above(const Paint& above) {
  return [=](int x, int y) { return y < kSkyline ? above(x, y) : Ground(x, y); };
}

void ExpectSkyAboveTheSkyline(const Capture& capture) {
  const std::vector<bool> sky = capture.Sky();
  ASSERT_EQ(sky.size(), capture.dataset.n_pixels());
  for (std::size_t i = 0; i < sky.size(); ++i)
    ASSERT_EQ(sky[i], static_cast<int>(i) / kColumns % kRows < kSkyline) << i;
}

void ExpectNoSky(const Paint& paint, const char* what) { EXPECT_TRUE(Capture(paint).Sky().empty()) << what; }

TEST(Sky, IsBlueOrNearlyWhiteAndMayHaveClouds) {
  ExpectSkyAboveTheSkyline(Capture(Above(Blue)));
  ExpectSkyAboveTheSkyline(Capture(Above([](int, int) { return Rgb{243, 240, 250}; })));
  ExpectSkyAboveTheSkyline(Capture(Above([](int x, int y) {
    const double whiteness = std::exp(-(x - 40) * (x - 40) / 300.0);
    const Rgb blue = Blue(x, y);
    return Rgb{blue[0] + static_cast<int>(whiteness * (200 - blue[0])),
               blue[1] + static_cast<int>(whiteness * (205 - blue[1])),
               210};
  })));
}

TEST(Sky, IsNotWhatOnlyLooksLikeOne) {
  ExpectNoSky(Ground, "ground");
  ExpectNoSky(Above([](int, int) { return Rgb{190, 190, 195}; }), "a grey wall");
  ExpectNoSky(Above([](int x, int y) {
                return Rgb{90 + 14 * (x / 2 % 2), 130, 200 + 14 * (y / 2 % 2)};
              }),
              "bricks");
  ExpectNoSky([](int x, int y) { return y < kHorizon + 20 ? Blue(x, y) : Ground(x, y); },
              "a wall that reaches below the horizon");
  ExpectNoSky([](int x, int y) { return y > 5 && y < kSkyline ? Blue(x, y) : Ground(x, y); },
              "a poster that ends before the edge of the picture");
  ExpectNoSky([](int x, int y) { return x < 10 && y < 10 ? Blue(x, y) : Ground(x, y); }, "a corner");
}

TEST(Sky, HasNothingBeforeIt) {
  Capture capture(Above(Blue));
  // Projects to (64, 20), (54, 20), (44, 20) of the three views.
  capture.scene.points = {{.xyz = {0, 2.8, -10}, .frame_indices = {0, 1, 2}}};
  const auto shows = [&](int view, int x, int y) -> bool {
    return capture.Sky()[static_cast<std::size_t>((view * kRows + y) * kColumns + x)];
  };
  for (int view = 0; view < 3; ++view) {
    EXPECT_FALSE(shows(view, 64 - 10 * view, 20)) << view;
    EXPECT_TRUE(shows(view, 100, 20)) << view;
    EXPECT_TRUE(shows(view, 64 - 10 * view, 10)) << view;
  }
  // Seen by two views only, or so far away that it may be a cloud.
  capture.scene.points = {{.xyz = {0, 2.8, -10}, .frame_indices = {0, 2}}};
  EXPECT_TRUE(shows(0, 64, 20));
  capture.scene.points = {{.xyz = {0, 28, -100}, .frame_indices = {0, 1, 2}}};
  EXPECT_TRUE(shows(0, 64, 20));
}

}  // namespace
}  // namespace nerf
