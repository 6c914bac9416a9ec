// The subject on a turntable, told from a background that stands still.
#include "sfm/scene/moving_subject.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "io/base/error.h"
#include "io/image/image.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 160, kHeight = 120, kPictures = 20;

// Pictures in `folder` by cameras of focal length 100 at the origin, looking along -z.
io::Scene SceneOf(int n, const fs::path& folder) {
  io::Scene scene;
  scene.cameras.push_back({.width = kWidth, .height = kHeight, .fl_x = 100, .fl_y = 100, .cx = 80, .cy = 60});
  for (int i = 0; i < n; ++i)
    scene.frames.push_back({.image_path = folder / ("p" + std::to_string(i) + ".png")});
  return scene;
}

// Where the middle of the disc is in picture i: it swings 6 pixels to and fro.
double CentreX(int i) { return 80 + 6 * std::sin(2 * std::numbers::pi * i / kPictures); }

// Before a noisy pattern turns a disc of radius 30. Its rim is of two colours, its middle plain, as dark
// metal is. A clock in the corner changes too.
io::Scene WriteTurntable(const fs::path& folder) {
  io::Scene scene = SceneOf(kPictures, folder);
  for (int i = 0; i < kPictures; ++i)
    scene.frames[static_cast<std::size_t>(i)].world_from_cam.translation.x() = (80 - CentreX(i)) / 100;
  std::vector<int> all(kPictures);
  std::iota(all.begin(), all.end(), 0);
  scene.points.push_back({.xyz = {0.6, 0.4, -1}});  // behind the disc, and nobody observes it
  for (double x = -25; x <= 25; x += 5) {
    for (double y = -25; y <= 25; y += 5) {
      if (std::hypot(x, y) > 16 && std::hypot(x, y) < 26)  // none in the plain middle

        scene.points.push_back({.xyz = {x / 100, y / 100, -1}, .frame_indices = all});
    }
  }
  std::mt19937 random(7);
  for (int i = 0; i < kPictures; ++i) {
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    const double angle = 2 * std::numbers::pi * i / kPictures;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double dx = x - CentreX(i), dy = y - 60.0, r = std::hypot(dx, dy);
        int value = (x / 8 + y / 8) % 2 == 0 ? 180 : 80;
        if (r < 30) value = 40;
        if (r > 18 && r < 30) value = std::cos(2 * (std::atan2(dy, dx) - angle)) > 0 ? 220 : 120;
        if (x < 5 && y < 5) value = i % 2 == 0 ? 0 : 255;
        for (int c = 0; c < 3; ++c)
          image.data[static_cast<std::size_t>(3 * (y * kWidth + x) + c)] =
              static_cast<std::uint8_t>(value + static_cast<int>(random() % 9) - 4);
      }
    }
    io::WriteImage(scene.frames[static_cast<std::size_t>(i)].image_path, image);
  }
  return scene;
}

TEST(SubjectsOnTurntable, AreShownWithTheirPlainMiddleAndNothingElse) {
  const TempDir dir;
  const io::Scene scene = WriteTurntable(dir.path());
  const std::vector<sfm::MovingSubject> subjects = sfm::SubjectsOnTurntable(scene, 2);
  ASSERT_EQ(subjects.size(), scene.frames.size());
  int n_inside = 0, n_shown = 0;
  for (int i = 0; i < kPictures; ++i) {
    const auto& [shown, certain] = subjects[static_cast<std::size_t>(i)];
    for (const io::Mask* mask : {&shown, &certain}) {
      ASSERT_EQ(mask->width, kWidth);
      ASSERT_EQ(mask->height, kHeight);
    }
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto pixel = static_cast<std::size_t>(y * kWidth + x);
        const double r = std::hypot(x - CentreX(i), y - 60.0);
        const bool is_subject = shown.Uses(pixel) && certain.Uses(pixel),
                   is_background = !shown.Uses(pixel) && certain.Uses(pixel);
        if (r < 30) {
          ASSERT_FALSE(is_background) << i << " " << x << " " << y;
        }
        if (x < 7 && y < 7) {
          ASSERT_FALSE(is_subject) << i << " " << x << " " << y;
        } else if (r > 51) {
          ASSERT_TRUE(is_background) << i << " " << x << " " << y;
        }
        if (std::hypot(x - 80, y - 60) < 6) {  // never anything but the middle
          ASSERT_TRUE(is_subject) << i << " " << x << " " << y;
        }
        n_inside += r < 30;
        n_shown += r < 30 && shown.Uses(pixel);
      }
    }
  }
  EXPECT_GT(n_shown, 0.6 * n_inside);
  const sfm::MovingSubject again = sfm::SubjectsOnTurntable(scene, 1)[3];
  EXPECT_EQ(again.shown.used, subjects[3].shown.used);
  EXPECT_EQ(again.certain.used, subjects[3].certain.used);
}

TEST(SubjectsOnTurntable, AGapItsEdgeAndPlacesThatItNeverLeavesMayBeEither) {
  // A ring that swings by 12 pixels: what shows in its middle is the background, but not always the same.
  const TempDir dir;
  const io::Scene scene = SceneOf(kPictures, dir.path());
  for (int i = 0; i < kPictures; ++i) {
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double r = std::hypot(x - 80 - 2 * (CentreX(i) - 80), y - 60.0);
        int value = (x / 8 + y / 8) % 2 == 0 ? 180 : 80;
        if (r > 14 && r < 30) value = 13 * i;
        std::fill_n(image.Pixel(x, y), 3, static_cast<std::uint8_t>(value));
      }
    }
    io::WriteImage(scene.frames[static_cast<std::size_t>(i)].image_path, image);
  }
  const std::vector<sfm::MovingSubject> subjects = sfm::SubjectsOnTurntable(scene, 1);
  ASSERT_EQ(subjects.size(), scene.frames.size());
  int n_gap = 0, n_certain = 0;
  for (int i = 0; i < kPictures; ++i) {
    const bool differs = std::abs(13 * i - 80) > 32 && std::abs(13 * i - 180) > 32;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto pixel = static_cast<std::size_t>(y * kWidth + x);
        const double r = std::hypot(x - 80 - 2 * (CentreX(i) - 80), y - 60.0);
        const bool is_certain = subjects[static_cast<std::size_t>(i)].certain.Uses(pixel);
        if (differs && (std::abs(r - 30) < 1 || (x == 80 && y == 38))) {
          ASSERT_FALSE(is_certain) << i << " " << x << " " << y;
        }
        n_gap += r <= 11;
        n_certain += r <= 11 && is_certain;
      }
    }
  }
  // But for the very middle, which never changes.
  EXPECT_LT(n_certain, 0.2 * n_gap);
}

TEST(SubjectsOnTurntable, PlainOnesAreToldByPointsThatOtherPicturesObserve) {
  // A disc of one colour swings by 12 pixels; it covers most of its place nearly always.
  const TempDir dir;
  io::Scene scene = SceneOf(kPictures, dir.path());
  for (int x = -26; x <= 26; x += 4) {
    for (int y = -26; y <= 26; y += 4) {
      if (std::hypot(x, y) < 28)
        scene.points.push_back({.xyz = {x / 100.0, y / 100.0, -1}, .frame_indices = {0, 1, 2}});
    }
  }
  for (int i = 0; i < kPictures; ++i) {
    const double swing = 2 * (CentreX(i) - 80);
    scene.frames[static_cast<std::size_t>(i)].world_from_cam.translation.x() = -swing / 100;
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool is_disc = std::hypot(x - 80 - swing, y - 60.0) < 30;
        std::fill_n(image.Pixel(x, y), 3, is_disc ? 40 : (x / 8 + y / 8) % 2 == 0 ? 180 : 80);
      }
    }
    io::WriteImage(scene.frames[static_cast<std::size_t>(i)].image_path, image);
  }
  const std::vector<sfm::MovingSubject> subjects = sfm::SubjectsOnTurntable(scene, 1);
  ASSERT_EQ(subjects.size(), scene.frames.size());
  for (int i = 0; i < kPictures; ++i) {
    const auto& [shown, certain] = subjects[static_cast<std::size_t>(i)];
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto pixel = static_cast<std::size_t>(y * kWidth + x);
        const double r = std::hypot(x - 80 - 2 * (CentreX(i) - 80), y - 60.0);
        if (r < 20) {
          ASSERT_TRUE(shown.Uses(pixel) && certain.Uses(pixel)) << i << " " << x << " " << y;
        }
        if (r > 32) {
          ASSERT_FALSE(shown.Uses(pixel) && certain.Uses(pixel)) << i << " " << x << " " << y;
        }
      }
    }
  }
}

TEST(SubjectsOnTurntable, BackgroundBetweenPointsIsNotCertainlyTheSubject) {
  // Two bars with a gap between them swing by 24 pixels.
  const TempDir dir;
  io::Scene scene = SceneOf(kPictures, dir.path());
  for (int x = 7; x < 18; x += 5) {
    for (int y = -20; y <= 20; y += 4) {
      for (const double side : {-1.0, 1.0})
        scene.points.push_back({.xyz = {side * x / 100, y / 100.0, -1}, .frame_indices = {0, 1, 2}});
    }
  }
  for (int i = 0; i < kPictures; ++i) {
    const double swing = 4 * (CentreX(i) - 80);
    scene.frames[static_cast<std::size_t>(i)].world_from_cam.translation.x() = -swing / 100;
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double across = std::abs(x - 80 - swing);
        const bool is_bar = across > 6 && across < 18 && std::abs(y - 60) < 22;
        std::fill_n(image.Pixel(x, y), 3, is_bar ? 40 : (x / 8 + y / 8) % 2 == 0 ? 180 : 80);
      }
    }
    io::WriteImage(scene.frames[static_cast<std::size_t>(i)].image_path, image);
  }
  const std::vector<sfm::MovingSubject> subjects = sfm::SubjectsOnTurntable(scene, 1);
  ASSERT_EQ(subjects.size(), scene.frames.size());
  const std::size_t middle = 60 * kWidth + 80;
  int n_gaps = 0;
  for (int i = 0; i < kPictures; ++i) {
    if (std::abs(CentreX(i) - 80) > 0.5) continue;
    ++n_gaps;
    EXPECT_FALSE(subjects[static_cast<std::size_t>(i)].certain.Uses(middle)) << i;
  }
  EXPECT_GT(n_gaps, 0);
}

TEST(CutOut, TakesThePixelThatCoversMost) {
  const sfm::CutPicture cut = sfm::CutOut(io::MakeImage(5, 1, 3), {}, {{2, 1, {0, 255}}, {2, 1, {255, 255}}});
  for (int x = 0; x < 5; ++x) EXPECT_EQ(cut.image.Pixel(x, 0)[3], x < 2 ? 0 : 255);
  EXPECT_EQ(cut.certain.UsedCount(), 5u);
}

TEST(CutOut, IsTransparentWhereTheBackgroundShowsAtAnySize) {
  io::Image picture = io::MakeImage(4, 2, 3);
  std::iota(picture.data.begin(), picture.data.end(), std::uint8_t{1});
  const sfm::CutPicture cut = sfm::CutOut(picture, {}, {{2, 1, {0, 255}}, {2, 1, {255, 0}}});
  ASSERT_EQ(cut.image.channels, 4);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 4; ++x) {
      for (int c = 0; c < 3; ++c) EXPECT_EQ(cut.image.Pixel(x, y)[c], picture.Pixel(x, y)[c]);
      EXPECT_EQ(cut.image.Pixel(x, y)[3], x < 2 ? 0 : 255);
      EXPECT_EQ(cut.certain.Uses(static_cast<std::size_t>(4 * y + x)), x < 2);
    }
  }
}

TEST(CutOut, IsNotCertainOfWhatAMaskLeavesOut) {
  const io::Mask used{4, 1, {255, 0, 255, 0}};
  const sfm::CutPicture cut = sfm::CutOut(io::MakeImage(4, 1, 3), used, {{2, 1, {0, 255}}, {2, 1, {255, 0}}});
  EXPECT_EQ(cut.certain.used, (std::vector<std::uint8_t>{255, 0, 0, 0}));
}

TEST(SubjectsOnTurntable, ACameraThatMovesLeavesNothingInItsPlace) {
  const TempDir dir;
  const io::Scene scene = SceneOf(kPictures, dir.path());
  for (int i = 0; i < kPictures; ++i) {
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    for (std::size_t k = 0; k < image.data.size(); ++k)
      image.data[k] =
          ((k / 3 % kWidth + static_cast<std::size_t>(5 * i)) / 8 + k / 3 / kWidth / 8) % 2 == 0 ? 180 : 80;
    io::WriteImage(scene.frames[static_cast<std::size_t>(i)].image_path, image);
  }
  EXPECT_TRUE(sfm::SubjectsOnTurntable(scene, 1).empty());
}

TEST(SubjectsOnTurntable, NothingThatMovesOrPicturesOfTwoSizesGiveNone) {
  const TempDir dir;
  EXPECT_TRUE(sfm::SubjectsOnTurntable({}, 1).empty());
  io::Scene scene = WriteTurntable(dir.path());
  io::Scene same = scene;
  same.points.clear();
  for (io::Frame& frame : same.frames) frame.image_path = scene.frames[0].image_path;
  EXPECT_TRUE(sfm::SubjectsOnTurntable(same, 1).empty());
  io::WriteImage(scene.frames[3].image_path, io::MakeImage(kWidth / 2, kHeight, 3));
  EXPECT_TRUE(sfm::SubjectsOnTurntable(scene, 1).empty());
  fs::remove(scene.frames[5].image_path);
  EXPECT_THROW(sfm::SubjectsOnTurntable(scene, 1), io::Error);
}

}  // namespace
