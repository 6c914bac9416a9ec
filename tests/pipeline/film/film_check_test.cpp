// The check of a finished film names jumps and lone frames, and is silent on smooth motion.
#include "pipeline/film/film_check.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/scenes/look_at.h"

namespace {

using Eigen::Vector3d;

// Waves that pass; `place` says how far.
io::Image Waves(double place) {
  io::Image image;
  image.width = 128;
  image.height = 96;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double wave = std::sin(0.1 * (x + place)) * std::cos(0.07 * y);
      for (int c = 0; c < 3; ++c)
        image.data.push_back(static_cast<std::uint8_t>(std::lround(128 + 100 * wave)));
    }
  }
  return image;
}

// Swings to and fro: fast in the middle, slow at the ends.
std::vector<std::string> Swing() {
  std::vector<std::string> film;
  for (int i = 0; i < 60; ++i) film.push_back(pipeline::Thumbnail(Waves(20 * std::cos(0.1 * i))));
  return film;
}

TEST(FilmCheck, SmoothMotionHasNoFaults) {
  const pipeline::FilmFaults faults = pipeline::FaultsOf(Swing());
  EXPECT_TRUE(faults.jumps.empty());
  EXPECT_TRUE(faults.lone.empty());
  EXPECT_TRUE(pipeline::CheckFrames(Swing()).empty());
  EXPECT_TRUE(pipeline::CheckFrames({}).empty());
}

TEST(FilmCheck, AStillFilmHasNoFaults) {
  std::vector<std::string> film(30, pipeline::Thumbnail(Waves(0)));
  film[10] = pipeline::Thumbnail(Waves(0.1));
  EXPECT_TRUE(pipeline::CheckFrames(film).empty());
}

TEST(FilmCheck, ALoneFrameIsNamed) {
  std::vector<std::string> film = Swing();
  film[20] = std::string(film[20].size(), 20);  // veiled
  const pipeline::FilmFaults faults = pipeline::FaultsOf(film);
  EXPECT_EQ(faults.lone, std::vector<int>{20});
  EXPECT_TRUE(faults.jumps.empty());
  EXPECT_EQ(pipeline::CheckFrames(film),
            std::vector<std::string>{"warning: unlike the frames before and after it: frame 21"});
}

TEST(FilmCheck, AJumpIsNamed) {
  std::vector<std::string> film = Swing();
  for (int i = 30; i < 60; ++i)
    film[static_cast<std::size_t>(i)] = pipeline::Thumbnail(Waves(30 + 20 * std::cos(0.1 * i)));
  const pipeline::FilmFaults faults = pipeline::FaultsOf(film);
  EXPECT_EQ(faults.jumps, std::vector<int>{30});
  EXPECT_TRUE(faults.lone.empty());
  EXPECT_EQ(pipeline::CheckFrames(film), std::vector<std::string>{"warning: the picture jumps to frame 31"});
}

TEST(FilmCheck, AJumpOfThePathIsNamed) {
  nerf::CameraPath path;
  path.kind = nerf::PathKind::kWalk;
  path.capture.depth = 2;
  for (int i = 0; i < 60; ++i) {
    const Vector3d place(0.01 * i + (i < 40 ? 0 : 0.1), 0, 0);
    path.world_from_cam.push_back(LookAt(place, place + Vector3d::UnitY(), Vector3d::UnitZ()));
  }
  const std::vector<std::string> lines = pipeline::CheckPath(path);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_NE(lines[0].find("11.0 times the median"), std::string::npos) << lines[0];
  EXPECT_EQ(lines[1], "warning: the camera path jumps to frame 41");
  path.world_from_cam.resize(40);
  EXPECT_EQ(pipeline::CheckPath(path).size(), 1u);
}

}  // namespace
