// What goes into COLMAP's database comes out of it, and damage is noticed.
#include "sfm/colmap/colmap_database.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cmath>
#include <cstdlib>

#include "io/base/error.h"
#include "io/process/process.h"
#include "tests/support/files/colmap_tables.h"
#include "tests/support/files/temp_dir.h"

namespace {

// All rows of a query as text; blobs as hexadecimal digits.
std::string Query(const std::filesystem::path& path, const std::string& query) {
  sqlite3* handle = nullptr;
  EXPECT_EQ(sqlite3_open(path.c_str(), &handle), SQLITE_OK);
  std::string text;
  const auto row = [](void* out, int n, char** values, char**) {
    for (int i = 0; i < n; ++i)
      *static_cast<std::string*>(out) += std::string(i ? "|" : "") + (values[i] ? values[i] : "NULL");
    *static_cast<std::string*>(out) += ";";
    return 0;
  };
  EXPECT_EQ(sqlite3_exec(handle, query.c_str(), row, &text, nullptr), SQLITE_OK) << sqlite3_errmsg(handle);
  sqlite3_close(handle);
  return text;
}

sfm::Features TwoFeatures() {
  sfm::Features features;
  features.keypoints = {{1, 2, 3, 0.5}, {4, 5, 6, -0.5}};
  return features;
}

TEST(ColmapDatabase, PicturesAndCameras) {
  TempDir folder;
  const auto path = folder / "d.db";
  CreateDatabase(path, true);
  sfm::WritePictures(path,
                     {{.names = {"b.png"}, .width = 100, .height = 50},
                      {.names = {"a.png", "c.png"}, .width = 60, .height = 80, .focal_px = 70}},
                     "SIMPLE_RADIAL",
                     {"a.png", "b.png", "c.png"},
                     {TwoFeatures(), {}, TwoFeatures()});
  EXPECT_EQ(
      Query(path, "SELECT camera_id, model, width, height, prior_focal_length, length(params) FROM cameras"),
      "1|2|100|50|0|32;2|2|60|80|1|32;");
  // 120 = 1.2 * 100, 50, 25, 0 as little-endian doubles.
  EXPECT_EQ(Query(path, "SELECT hex(params) FROM cameras WHERE camera_id = 1"),
            "0000000000005E40000000000000494000000000000039400000000000000000;");
  EXPECT_EQ(Query(path, "SELECT hex(params) FROM cameras WHERE camera_id = 2"),
            "00000000008051400000000000003E4000000000000044400000000000000000;");  // 70, 30, 40, 0
  EXPECT_EQ(Query(path, "SELECT * FROM images"), "1|a.png|2;2|b.png|1;3|c.png|2;");
  EXPECT_EQ(Query(path, "SELECT image_id, rows, cols FROM keypoints"), "1|2|4;2|0|4;3|2|4;");
  EXPECT_EQ(Query(path, "SELECT * FROM rigs"), "1|1|0;2|2|0;");
  EXPECT_EQ(Query(path, "SELECT * FROM frames"), "1|2;2|1;3|2;");
  EXPECT_EQ(Query(path, "SELECT * FROM frame_data"), "1|1|2|0;2|2|1|0;3|3|2|0;");
}

TEST(ColmapDatabase, EveryModelHasItsNumberAndParameters) {
  // Of https://colmap.github.io/cameras.html; the parameters are doubles.
  const std::pair<std::string, std::string> models[] = {{"SIMPLE_PINHOLE", "0|24;"},
                                                        {"PINHOLE", "1|32;"},
                                                        {"SIMPLE_RADIAL", "2|32;"},
                                                        {"RADIAL", "3|40;"},
                                                        {"OPENCV", "4|64;"}};
  for (const auto& [model, expected] : models) {
    TempDir folder;
    CreateDatabase(folder / "d.db", false);
    sfm::WritePictures(folder / "d.db", {{.width = 10, .height = 10}}, model, {}, {});
    EXPECT_EQ(Query(folder / "d.db", "SELECT model, length(params) FROM cameras"), expected) << model;
  }
}

TEST(ColmapDatabase, MatchesRunFromTheSmallerImageId) {
  TempDir folder;
  const auto path = folder / "d.db";
  CreateDatabase(path, false);
  const std::vector<std::string> names = {"a.png", "b.png"};
  sfm::WritePictures(
      path, {{.names = names, .width = 10, .height = 10}}, "PINHOLE", names, {TwoFeatures(), TwoFeatures()});
  const std::string written = "2147483649|1|2|0100000000000000;";
  sfm::WriteMatches(path, {"b.png", "a.png"}, {{.a = 0, .b = 1, .matches = {{0, 1}}}});
  EXPECT_EQ(Query(path, "SELECT pair_id, rows, cols, hex(data) FROM matches"), written);
  Query(path, "DELETE FROM matches");
  sfm::WriteMatches(path, names, {{.a = 0, .b = 1, .matches = {{1, 0}}}});
  EXPECT_EQ(Query(path, "SELECT pair_id, rows, cols, hex(data) FROM matches"), written);
}

TEST(ColmapDatabase, FeaturesOfColmapAreRead) {
  TempDir folder;
  const auto path = folder / "d.db";
  CreateDatabase(path, false);
  const std::vector<std::string> names = {"a.png", "b.png"};
  sfm::WritePictures(
      path, {{.names = names, .width = 10, .height = 10}}, "PINHOLE", names, {TwoFeatures(), {}});
  EXPECT_THROW(sfm::ReadFeatures(path, names), io::Error);  // keypoints without descriptors
  Query(path, "INSERT INTO descriptors VALUES(1, 2, 128, zeroblob(256))");
  const auto features = sfm::ReadFeatures(path, {"b.png", "a.png"});
  EXPECT_TRUE(features[0].keypoints.empty());
  ASSERT_EQ(features[1].keypoints.size(), 2u);
  EXPECT_EQ(features[1].keypoints[1].x, 4);
  EXPECT_EQ(features[1].keypoints[1].angle, -0.5f);
  EXPECT_EQ(features[1].descriptors.size(), 256u);
  EXPECT_THROW(sfm::ReadFeatures(path, {"missing.png"}), io::Error);
  Query(path, "UPDATE keypoints SET cols = 6 WHERE image_id = 1");
  EXPECT_THROW(sfm::ReadFeatures(path, names), io::Error);  // 2 x 4 floats stored
  Query(path, "UPDATE keypoints SET rows = 3, cols = 4 WHERE image_id = 1");
  EXPECT_THROW(sfm::ReadFeatures(path, names), io::Error);
  // As many bytes as 32 bits have room for, and none of them there.
  Query(path, "UPDATE keypoints SET rows = 268435456, data = zeroblob(0) WHERE image_id = 1");
  try {
    sfm::ReadFeatures(path, names);
    FAIL();
  } catch (const io::Error& error) {
    EXPECT_NE(std::string(error.what()).find("keypoints of a picture"), std::string::npos) << error.what();
  }
}

TEST(ColmapDatabase, AffineShapesBecomeScaleAndAngle) {
  TempDir folder;
  const auto path = folder / "d.db";
  CreateDatabase(path, false);
  Query(path, "INSERT INTO images VALUES(1, 'a.png', 1)");
  // 7, 8, and the shape 0 -2; 2 0 plus a shear of 1: a quarter turn from +x towards +y.
  Query(path,
        "INSERT INTO keypoints VALUES(1, 1, 6, x'0000E04000000041000000000000"
        "00C0000000400000803F')");
  Query(path, "INSERT INTO descriptors VALUES(1, 1, 128, zeroblob(128))");
  const sfm::Features features = sfm::ReadFeatures(path, {"a.png"})[0];
  ASSERT_EQ(features.keypoints.size(), 1u);
  EXPECT_EQ(features.keypoints[0].y, 8);
  EXPECT_FLOAT_EQ(features.keypoints[0].scale, 2);
  EXPECT_FLOAT_EQ(features.keypoints[0].angle, static_cast<float>(M_PI / 2));
}

TEST(ColmapDatabase, GeometriesAreWrittenAndRead) {
  TempDir folder;
  const auto path = folder / "d.db";
  CreateDatabase(path, false);
  const std::vector<std::string> names = {"a.png", "b.png", "c.png"};
  sfm::WritePictures(
      path, {{.names = names, .width = 10, .height = 10}}, "PINHOLE", names, std::vector<sfm::Features>(3));
  // The second one has nothing, and the third its pictures the other way round.
  sfm::WriteGeometries(path,
                       {"c.png", "b.png", "a.png"},
                       {{2, 1, {}}, {2, 0, {}}, {0, 1, {}}},
                       {{sfm::TwoViewKind::kEpipolar, {{1, 2}, {3, 4}}},
                        {},
                        {sfm::TwoViewKind::kHomography, {{5, 6}, {7, 8}, {9, 10}}}});
  const auto pairs = sfm::ReadVerifiedPairs(path);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].name_a + pairs[0].name_b, "a.pngb.png");
  EXPECT_EQ(pairs[0].inliers, 2);
  EXPECT_EQ(pairs[0].matches, (std::vector<std::array<int, 2>>{{1, 2}, {3, 4}}));
  EXPECT_EQ(pairs[0].geometry, sfm::PairGeometry::kGeneral);
  EXPECT_EQ(pairs[1].name_a + pairs[1].name_b, "b.pngc.png");
  EXPECT_EQ(pairs[1].matches, (std::vector<std::array<int, 2>>{{6, 5}, {8, 7}, {10, 9}}));
  EXPECT_EQ(pairs[1].geometry, sfm::PairGeometry::kHomography);
  // Calibrated, uncalibrated, planar, panoramic, planar or panoramic, several rigid motions.
  for (const auto& [config, flat] :
       {std::pair{2, false}, {3, false}, {4, true}, {5, true}, {6, true}, {7, false}}) {
    Query(path, "UPDATE two_view_geometries SET config = " + std::to_string(config));
    EXPECT_EQ(sfm::ReadVerifiedPairs(path)[0].geometry == sfm::PairGeometry::kHomography, flat) << config;
  }
  Query(path, "INSERT INTO two_view_geometries VALUES(4294967298, 20, 2, NULL, 1)");
  EXPECT_EQ(sfm::ReadVerifiedPairs(path).size(), 2u) << "degenerate";
  Query(path, "INSERT INTO two_view_geometries VALUES(9, 1, 2, zeroblob(8), 2)");
  EXPECT_ERROR(sfm::ReadVerifiedPairs(path), io::ExitCode::kBadState, "missing image");
  Query(path, "DELETE FROM two_view_geometries WHERE pair_id = 9");
  Query(path, "UPDATE two_view_geometries SET rows = 3 WHERE pair_id = 2147483649");
  EXPECT_ERROR(sfm::ReadVerifiedPairs(path), io::ExitCode::kBadState, "do not have the stated size");
}

TEST(ColmapDatabase, PairsOfUnchangedPicturesAreTakenOver) {
  TempDir folder;
  const auto from = folder / "from.db", to = folder / "to.db";
  const std::vector<std::string> names = {"a.png", "b.png", "c.png"};
  for (const auto& path : {from, to}) {
    CreateDatabase(path, false);
    sfm::WritePictures(
        path, {{.names = names, .width = 10, .height = 10}}, "PINHOLE", names, std::vector<sfm::Features>(3));
    sfm::WriteMatches(path, names, {{path == from ? 0 : 1, 2, {{1, 1}}}});
  }
  sfm::WriteMatches(from, names, {{0, 1, {{4, 5}}}});
  Query(from,
        "INSERT INTO two_view_geometries VALUES(2147483649, 1, 2, zeroblob(8), 2), "
        "(2147483650, 1, 2, zeroblob(8), 2), (4294967297, 1, 2, zeroblob(8), 2)");
  sfm::CopyPairs(
      from, to, [](const std::string& a, const std::string& b) { return a != "c.png" && b != "c.png"; });
  const auto pairs = sfm::ReadVerifiedPairs(to);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0].name_a + pairs[0].name_b, "a.pngb.png");
  EXPECT_EQ(Query(to, "SELECT pair_id FROM matches"), "2147483649;4294967297;");
  Query(to, "DELETE FROM images WHERE name = 'b.png'");
  EXPECT_ERROR(sfm::CopyPairs(from, to, [](const std::string&, const std::string&) { return false; }),
               io::ExitCode::kBadState,
               "missing image");
}

TEST(ColmapDatabase, WhatIsNoDatabaseIsRefused) {
  TempDir folder;
  EXPECT_THROW(sfm::ReadVerifiedPairs(folder / "missing.db"), io::Error);
  std::ofstream(folder / "text.db")
      << "This is not a database, though it is longer than a header of SQLite. ";
  EXPECT_THROW(sfm::ReadVerifiedPairs(folder / "text.db"), io::Error);
}

}  // namespace
