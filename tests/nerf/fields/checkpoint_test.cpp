// What a checkpoint holds comes back; one that is damaged, or whose header holds values of another type or
// size under a right hash, is refused by name.
#include "nerf/fields/checkpoint.h"
#include "io/base/json.h"

#include <cstring>
#include <nlohmann/json.hpp>
#include <set>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/small_field.h"
#include "tests/support/scenes/some_splats.h"

namespace nerf {
namespace {

using io::Json;

constexpr std::size_t kLengthAt = 8, kHashAt = 12, kHeaderAt = 44;  // after the magic; the header's hash; it

// A checkpoint taken apart.
struct Parts {
  explicit Parts(const std::string& file) : magic(file.substr(0, kLengthAt)) {
    std::uint32_t length;
    std::memcpy(&length, file.data() + kLengthAt, sizeof length);
    header = io::ParseJson(file.substr(kHeaderAt, length));
    tensors = file.substr(kHeaderAt + length);
  }
  std::string With(const Json& other) const { return WithText(io::DumpJson(other)); }
  std::string WithText(const std::string& text) const { return Start(text) + tensors; }
  // What stands before the tensors.
  std::string Start(const std::string& text) const {
    const auto length = static_cast<std::uint32_t>(text.size());
    std::string file = magic;
    file.append(reinterpret_cast<const char*>(&length), kHashAt - kLengthAt);
    return file + io::HashBytes(text) + text;
  }

  std::string magic, tensors;
  Json header;
};

// "accepted", or the refusal.
std::string VerdictOn(const std::filesystem::path& path) {
  TrainState state;
  try {
    ReadCheckpoint(path, &state);
  } catch (const io::Error& error) {
    EXPECT_EQ(error.code(), io::ExitCode::kBadState) << error.what();
    return error.what();
  }
  return "accepted";
}

// Reads the file; what is thrown must be a refusal that names it.
void ReadOrRefuse(const std::filesystem::path& path, const std::string& what) {
  const auto refusal_of = [&](const auto& read) -> std::string {
    try {
      read();
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kBadState) << what << ": " << error.what();
      return error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << what << ": " << error.what();
    }
    return "";
  };
  TrainState state;
  refusal_of([&] { ReadCheckpoint(path, &state); });
  refusal_of([&] { KindOfCheckpoint(path); });
}

TEST(CheckpointHeader, ValuesOfAnotherTypeOrSizeOrMissingOnesAreRefused) {
  const TempDir dir;
  const std::filesystem::path path = dir / "checkpoint.bin";
  SceneField scene_field = tests::SmallField();
  scene_field.background = {0.5f, 0.5f, 0.5f};
  scene_field.splats = tests::SomeSplats(3);
  TrainState state{.transients = {.shown = {0, 1, 1}, .last_look = 150}};
  state.splats.moments = FirstMoments(scene_field.splats);
  WriteCheckpoint(path, &scene_field, state);

  const Parts parts(ReadText(path));
  // With blanks behind it every header is as long, and only the start of the file is written again.
  const std::size_t length = io::DumpJson(parts.header).size() + 512;
  const auto text_of = [&](const Json& header) {
    std::string text = io::DumpJson(header);
    EXPECT_LE(text.size(), length);
    text.resize(length, ' ');
    return text;
  };
  const auto write = [&](const Json& header) {
    std::fstream(path, std::ios::binary | std::ios::in | std::ios::out) << parts.Start(text_of(header));
  };
  WriteText(path, parts.WithText(text_of(parts.header)));
  ASSERT_NE(ReadCheckpoint(path, &state), nullptr);
  int n_tried = 0;
  const std::vector<Json> values = {
      nullptr, true, -1, 0, 1, 4.5, 65, 100, 1e300, -1e300, "", "x", Json::array(), {7}, Json::object()};
  const Json leaves = parts.header.flatten();
  std::set<std::string> tried;
  for (const auto& member : leaves.items()) {
    // The value itself, and every object and array that holds it.
    for (Json::json_pointer place(member.key()); !place.empty(); place = place.parent_pointer()) {
      if (!tried.insert(place.to_string()).second) break;
      for (const Json& value : values) {
        Json header = parts.header;
        header[place] = value;
        write(header);
        ReadOrRefuse(path, place.to_string() + " = " + io::DumpJson(value));
        ++n_tried;
      }
      Json header = parts.header;
      Json& parent = header[place.parent_pointer()];
      if (parent.is_object()) {
        parent.erase(place.back());
        write(header);
        ReadOrRefuse(path, place.to_string() + " is missing");
        ++n_tried;
      }
    }
  }
  EXPECT_GT(n_tried, 500);
}

TEST(CheckpointHeader, WhatIsRefusedIsNamed) {
  const TempDir dir;
  const std::filesystem::path path = dir / "checkpoint.bin";
  SceneField scene_field = tests::SmallField();
  WriteCheckpoint(path, &scene_field, {});
  const Parts parts(ReadText(path));
  const struct {
    const char* place;
    Json value;
    std::string words;
  } cases[] = {
      {"/field", "x", "unknown kind 'x'"},
      {"/state/step", 1.5, "step is not a whole number"},
      {"/pixel_rays", 2, "pixel_rays is not a square number"},
      {"/step_scale", 0, "step_scale is out of range"},
      {"/tensors/0/name", "x", "has another size"},
      {"/tensors/0/bytes", 1, "has another size"},
      {"/tensors/0/hash", "x", "hash of tensor"},
  };
  for (const auto& [place, value, words] : cases) {
    Json header = parts.header;
    header[Json::json_pointer(place)] = value;
    WriteText(path, parts.With(header));
    EXPECT_NE(VerdictOn(path).find(words), std::string::npos) << place << ": " << VerdictOn(path);
  }
  for (const char* name : {"map", "sampling", "state", "config", "splats", "tensors"}) {
    Json without = parts.header;
    without.erase(name);
    WriteText(path, parts.With(without));
    EXPECT_NE(VerdictOn(path).find(std::string("lacks ") + name), std::string::npos)
        << name << ": " << VerdictOn(path);
  }
  WriteText(path, parts.With(Json::object()));
  EXPECT_NE(VerdictOn(path).find("header lacks"), std::string::npos) << VerdictOn(path);
  for (const char* text : {"{", "7"}) {
    WriteText(path, parts.WithText(text));
    EXPECT_NE(VerdictOn(path).find("header is not JSON"), std::string::npos) << VerdictOn(path);
  }
}

TEST(Checkpoint, EveryDamageIsRejectedByName) {
  const TempDir dir;
  const std::filesystem::path path = dir / "checkpoint.bin";
  SceneField scene_field = tests::SmallField();
  WriteCheckpoint(path, &scene_field, {});
  const std::string good = ReadText(path);
  const auto verdict = [&](const std::string& bytes) {
    WriteText(path, bytes);
    return VerdictOn(path);
  };
  EXPECT_EQ(verdict(good), "accepted");
  EXPECT_NE(verdict("").find("not a checkpoint"), std::string::npos);
  EXPECT_NE(verdict(good.substr(0, 30)).find("not a checkpoint"), std::string::npos);
  EXPECT_NE(verdict(good.substr(0, 100)).find("cut off in its header"), std::string::npos);
  EXPECT_NE(verdict(good.substr(0, good.size() - 1)).find("cut off in tensor"), std::string::npos);
  EXPECT_NE(verdict(good + "x").find("after its last"), std::string::npos);
  std::string other_version = good;
  ++other_version[kLengthAt - 1];
  EXPECT_NE(verdict(other_version).find("not a checkpoint of this version"), std::string::npos);
  std::string other_header = good;
  other_header[kHeaderAt + 3] ^= 0x10;
  EXPECT_NE(verdict(other_header).find("header hash differs"), std::string::npos);
  int flipped = 0;
  for (std::size_t at = 0; at < good.size(); at += good.size() / 60, ++flipped) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    EXPECT_NE(verdict(bad), "accepted") << "flipped byte " << at;
  }
  EXPECT_GE(flipped, 60);
  WriteText(path, good);
  std::filesystem::resize_file(path, (std::uintmax_t{8} << 30) + 1);
  TrainState state;
  EXPECT_ERROR(ReadCheckpoint(path, &state), io::ExitCode::kBadInput, "larger than 8589934592 bytes");
}

TEST(Checkpoint, HoldsSplatsAndWhatFittingThemKeeps) {
  const TempDir dir;
  const std::filesystem::path path = dir / "checkpoint.bin";
  SceneField scene_field = tests::SmallField();
  scene_field.splats = tests::SomeSplats(7);
  scene_field.splat_focal_px = 321;
  scene_field.splat_share = 0.125f, scene_field.splat_share_behind = 0.5f;
  TrainState state, read;
  state.field_s = 3;
  state.splats = {.moments = FirstMoments(scene_field.splats),
                  .step = 12,
                  .is_judged = true,
                  .error_ratio = 1.5,
                  .begin_s = 4,
                  .squared_error = 0.25};
  state.splats.moments.m.colours[5] = 0.5f, state.splats.moments.v.rotations[27] = 0.75f;
  for (const bool is_finished : {false, true}) {
    if (is_finished) {
      state.splats.moments = {};
      scene_field.splat_shares.cells.assign(ShareMap::kCells, 7);
      scene_field.splat_shares.cells[12345] = 8;
    }
    WriteCheckpoint(path, &scene_field, state);
    const auto read_field = ReadCheckpoint(path, &read);
    EXPECT_EQ(read_field->splats.places, scene_field.splats.places);
    EXPECT_EQ(read_field->splats.log_scales, scene_field.splats.log_scales);
    EXPECT_EQ(read_field->splats.rotations, scene_field.splats.rotations);
    EXPECT_EQ(read_field->splats.opacities, scene_field.splats.opacities);
    EXPECT_EQ(read_field->splats.colours, scene_field.splats.colours);
    EXPECT_EQ(read_field->splat_focal_px, 321);
    EXPECT_EQ(read_field->splat_share, 0.125f);
    EXPECT_EQ(read_field->splat_share_behind, 0.5f);
    EXPECT_EQ(read_field->splat_shares.cells, scene_field.splat_shares.cells);
    EXPECT_EQ(read.splats.error_ratio, 1.5);
    EXPECT_EQ(read.field_s, 3);
    EXPECT_EQ(read.splats.step, 12u);
    EXPECT_TRUE(read.splats.is_judged);
    EXPECT_EQ(read.splats.begin_s, 4);
    EXPECT_EQ(read.splats.squared_error, 0.25);
    EXPECT_EQ(read.splats.moments.sizes, state.splats.moments.sizes);
    EXPECT_EQ(read.splats.moments.m.colours, state.splats.moments.m.colours);
    EXPECT_EQ(read.splats.moments.v.rotations, state.splats.moments.v.rotations);
  }
}

TEST(CheckpointHeader, GridsThatTheSamplerCannotWalkAreRefused) {
  const TempDir dir;
  const std::filesystem::path path = dir / "checkpoint.bin";
  SceneField scene_field = tests::SmallField();
  WriteCheckpoint(path, &scene_field, {});
  const Parts parts(ReadText(path));
  TrainState state;
  for (const int resolution : {65, 100, 127}) {
    Json header = parts.header;
    header["grid_resolution"] = resolution;
    WriteText(path, parts.With(header));
    EXPECT_THROW(ReadCheckpoint(path, &state), io::Error) << resolution;
  }
}

}  // namespace
}  // namespace nerf
