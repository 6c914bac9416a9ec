// A checkpoint whose header holds values of another type or size, under a right hash, is refused by name.
#include "nerf/fields/checkpoint.h"

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

using Json = nlohmann::json;

constexpr std::size_t kLengthAt = 8, kHashAt = 12, kHeaderAt = 44;  // after the magic; the header's hash; it

// A checkpoint taken apart.
struct Parts {
  explicit Parts(const std::string& file) : magic(file.substr(0, kLengthAt)) {
    std::uint32_t length;
    std::memcpy(&length, file.data() + kLengthAt, sizeof length);
    header = Json::parse(file.substr(kHeaderAt, length));
    tensors = file.substr(kHeaderAt + length);
  }
  std::string With(const Json& other) const {
    const std::string text = other.dump();
    const auto length = static_cast<std::uint32_t>(text.size());
    std::string file = magic;
    file.append(reinterpret_cast<const char*>(&length), kHashAt - kLengthAt);
    return file + io::HashBytes(text) + text + tensors;
  }

  std::string magic, tensors;
  Json header;
};

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
  TrainState state;
  state.splats.moments = FirstMoments(scene_field.splats);
  WriteCheckpoint(path, &scene_field, state);
  ASSERT_NE(ReadCheckpoint(path, &state), nullptr);

  const Parts parts(ReadText(path));
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
        WriteText(path, parts.With(header));
        ReadOrRefuse(path, place.to_string() + " = " + value.dump());
        ++n_tried;
      }
      Json header = parts.header;
      Json& parent = header[place.parent_pointer()];
      if (parent.is_object()) {
        parent.erase(place.back());
        WriteText(path, parts.With(header));
        ReadOrRefuse(path, place.to_string() + " is missing");
        ++n_tried;
      }
    }
  }
  EXPECT_GT(n_tried, 500);
}

TEST(Checkpoint, HoldsSplatsAndWhatFittingThemKeeps) {
  const TempDir dir;
  const std::filesystem::path path = dir / "checkpoint.bin";
  SceneField scene_field = tests::SmallField();
  scene_field.splats = tests::SomeSplats(7);
  scene_field.splat_focal_px = 321;
  scene_field.splat_share = 0.125f;
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
    if (is_finished) state.splats.moments = {};
    WriteCheckpoint(path, &scene_field, state);
    const auto read_field = ReadCheckpoint(path, &read);
    EXPECT_EQ(read_field->splats.places, scene_field.splats.places);
    EXPECT_EQ(read_field->splats.log_scales, scene_field.splats.log_scales);
    EXPECT_EQ(read_field->splats.rotations, scene_field.splats.rotations);
    EXPECT_EQ(read_field->splats.opacities, scene_field.splats.opacities);
    EXPECT_EQ(read_field->splats.colours, scene_field.splats.colours);
    EXPECT_EQ(read_field->splat_focal_px, 321);
    EXPECT_EQ(read_field->splat_share, 0.125f);
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
