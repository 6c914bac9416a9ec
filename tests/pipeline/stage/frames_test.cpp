// frames.json: what is written comes back, and damage is named by file and place.
#include "pipeline/stage/frames.h"
#include "io/base/json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

using io::ExitCode;
using io::Json;

pipeline::Frames TwoKeptOneDropped() {
  pipeline::Frames frames;
  frames.kept.push_back({.name = "a.png",
                         .source = "a b.jpg",
                         .width = 160,
                         .height = 120,
                         .sharpness = 1.0 / 3,
                         .focal_px = 151.7,
                         .has_mask = true,
                         .panorama = "p.png",
                         .heading_deg = 60,
                         .camera_group = 2,
                         .notes = {"grey expanded to RGB"}});
  frames.kept.push_back(
      {.name = "frame_000017.png", .source = "frame 17", .width = 80, .height = 60, .time_s = 0.68});
  frames.dropped = {{"b.jpg", "exact copy of a b.jpg"}};
  return frames;
}

TEST(Frames, WrittenOnesComeBack) {
  const TempDir dir;
  const pipeline::Frames written = TwoKeptOneDropped();
  pipeline::WriteFrames(dir / "frames.json", written);
  const pipeline::Frames read = pipeline::ReadFrames(dir / "frames.json");
  ASSERT_EQ(read.kept.size(), written.kept.size());
  for (std::size_t i = 0; i < read.kept.size(); ++i) {
    const pipeline::KeptPicture &a = read.kept[i], &b = written.kept[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.source, b.source);
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    EXPECT_EQ(a.sharpness, b.sharpness);
    EXPECT_EQ(a.focal_px, b.focal_px);
    EXPECT_EQ(a.has_mask, b.has_mask);
    EXPECT_EQ(a.panorama, b.panorama);
    EXPECT_EQ(a.heading_deg, b.heading_deg);
    EXPECT_EQ(a.camera_group, b.camera_group);
    EXPECT_EQ(a.time_s, b.time_s);
    EXPECT_EQ(a.notes, b.notes);
  }
  ASSERT_EQ(read.dropped.size(), 1u);
  EXPECT_EQ(read.dropped[0].source, written.dropped[0].source);
  EXPECT_EQ(read.dropped[0].reason, written.dropped[0].reason);
}

TEST(Frames, WithoutAFileTheStageThatMakesItIsNamed) {
  const TempDir dir;
  EXPECT_ERROR(pipeline::ReadFrames(dir / "frames.json"), ExitCode::kBadInput, "Run pipeline ingest first");
}

TEST(Frames, DamageIsNamedByFileAndPlace) {
  const TempDir dir;
  const auto path = dir / "frames.json";
  EXPECT_ERROR(pipeline::ReadFrames(path), ExitCode::kBadInput, "frames.json");
  pipeline::WriteFrames(path, TwoKeptOneDropped());
  const Json good = io::ParseJson(ReadText(path));
  const struct {
    const char *pointer, *value, *place;
  } kCases[] = {{"/kept", "7", "kept"},
                {"/dropped", "null", "dropped"},
                {"/kept/0", "[]", "kept[0]"},
                {"/kept/1/name", "\"../x.png\"", "kept[1].name"},
                {"/kept/1/name", "\"a.png\"", "kept[1].name"},
                {"/kept/1/name", "\"\"", "kept[1].name"},
                {"/kept/1/name", "3", "kept[1].name"},
                {"/kept/0/width", "0", "kept[0].width"},
                {"/kept/0/height", "12.5", "kept[0].height"},
                {"/kept/0/focal_px", "-1", "kept[0].focal_px"},
                {"/kept/0/mask", "\"yes\"", "kept[0].mask"},
                {"/kept/1/time_s", "\"0.68\"", "kept[1].time_s"},
                {"/kept/0/notes/0", "{}", "kept[0].notes[0]"},
                {"/dropped/0/reason", "null", "dropped[0].reason"}};
  for (const auto& c : kCases) {
    Json bad = good;
    bad[Json::json_pointer(c.pointer)] = io::ParseJson(c.value);
    WriteText(path, io::DumpJson(bad));
    EXPECT_ERROR(pipeline::ReadFrames(path), ExitCode::kBadInput, std::string("frames.json: ") + c.place);
  }
  WriteText(path, io::DumpJson(good).substr(0, 100));
  EXPECT_ERROR(pipeline::ReadFrames(path), ExitCode::kBadInput, "frames.json");
}

}  // namespace
