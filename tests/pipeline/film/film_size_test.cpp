// The film's size: whole within the ceiling, and what becomes smaller, in which order, where it is not.
#include "pipeline/film/film_size.h"

#include <gtest/gtest.h>

namespace pipeline {
namespace {

constexpr int kTrained = 512;

FilmSize LargeFilm() {
  return {.camera = {.width = 1280, .height = 960, .fl_x = 1200, .fl_y = 1200, .cx = 640, .cy = 480}};
}

// Seconds of a film whose field takes `field_s` at its size in training and whose splats, or all rays, take
// `picture_s` at 1280 wide.
std::string Keep(double ceiling_s, double field_s, double picture_s, bool has_splats, FilmSize* size) {
  return KeepUnder(
      ceiling_s,
      kTrained,
      has_splats,
      [&] {
        const double side = size->camera.width / 1280.0;
        return field_s * size->field_share * size->field_share + picture_s * side * side;
      },
      size);
}

TEST(FilmSize, IsWholeWithinTheCeiling) {
  FilmSize size = LargeFilm();
  EXPECT_EQ(Keep(180, 100, 70, true, &size), "");
  EXPECT_EQ(size.camera, LargeFilm().camera);
  EXPECT_EQ(size.field_share, 0.5);
}

TEST(FilmSize, TheFieldUnderSplatsBecomesSmallerBeforeTheFilm) {
  FilmSize size = LargeFilm();
  EXPECT_EQ(
      Keep(180, 800, 50, true, &size),
      "film 1280 wide, the field under the splats at 40 % of its size: else the frames would take 250 s; the "
      "ceiling is 180 s");
  EXPECT_LE(800 * size.field_share * size.field_share + 50, 182);

  size = LargeFilm();
  EXPECT_NE(Keep(180, 816, 100, true, &size), "");
  EXPECT_EQ(size.field_share, 0.35);
  EXPECT_LT(size.camera.width, 1280);
  EXPECT_GT(size.camera.width, 1000);
}

TEST(FilmSize, WithoutSplatsTheFilmBecomesSmaller) {
  FilmSize size = LargeFilm();
  EXPECT_EQ(Keep(180, 0, 320, false, &size),
            "film 960 wide instead of 1280: else the frames would take 320 s; the ceiling is 180 s");
  EXPECT_EQ(size.field_share, 0.5);
  EXPECT_EQ(size.camera.height, 720);
}

TEST(FilmSize, IsNeverNarrowerThanTheTrainingPictures) {
  for (const bool has_splats : {false, true}) {
    FilmSize size = LargeFilm();
    EXPECT_NE(Keep(1, 1000, 1000, has_splats, &size), "");
    EXPECT_EQ(size.camera.width, kTrained);
    EXPECT_EQ(size.field_share, has_splats ? 0.35 : 0.5);
  }
}

}  // namespace
}  // namespace pipeline
