// Support for tests: an empty database as COLMAP creates it.
#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <string>

// The tables of COLMAP 3.8 that are used here; with_rigs: those of 3.12 and later as well.
inline void CreateDatabase(const std::filesystem::path& path, bool with_rigs) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &handle), SQLITE_OK);
  std::string tables =
      "CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, "
      "params BLOB, "
      "prior_focal_length INTEGER);"
      "CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);"
      "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
      "CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
      "CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
      "CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB, "
      "config INTEGER);";
  if (with_rigs) {
    tables +=
        "CREATE TABLE rigs(rig_id INTEGER PRIMARY KEY, ref_sensor_id INTEGER, ref_sensor_type INTEGER);"
        "CREATE TABLE frames(frame_id INTEGER PRIMARY KEY, rig_id INTEGER);"
        "CREATE TABLE frame_data(frame_id INTEGER, data_id INTEGER, sensor_id INTEGER, sensor_type INTEGER);";
  }
  ASSERT_EQ(sqlite3_exec(handle, tables.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(handle);
}
