#include "pipeline/stage/frames.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/json_reader.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using io::Json;
using io::JsonReader;
namespace fs = std::filesystem;

constexpr int kMaxSide = 65535;
constexpr double kMaxNumber = std::numeric_limits<double>::max();

// COLMAP's lists of pairs separate names by blanks.
void CheckName(const JsonReader& json) {
  const std::string& name = json.String();
  if (name.empty() || name[0] == '.' ||
      name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-") !=
          std::string::npos) {
    json.Fail("'" + name + "' has characters other than letters, digits, '.', '_', '-'");
  }
}

std::optional<double> OptionalNumber(const JsonReader& json, const char* key, double min) {
  if (!json.Has(key) || json.At(key).IsNull()) return std::nullopt;
  return json.At(key).Number(min, kMaxNumber);
}

KeptPicture ReadKept(const JsonReader& json) {
  KeptPicture picture;
  CheckName(json.At("name"));
  picture.name = json.At("name").String();
  picture.source = json.At("source").String();
  picture.width = json.At("width").Integer(1, kMaxSide);
  picture.height = json.At("height").Integer(1, kMaxSide);
  picture.sharpness = json.At("sharpness").Number(0, kMaxNumber);
  picture.focal_px = OptionalNumber(json, "focal_px", 0);
  picture.has_mask = json.Has("mask") && json.At("mask").Bool();
  if (json.Has("panorama")) {
    picture.panorama = json.At("panorama").String();
    picture.heading_deg = json.At("heading_deg").Number(0, 360);
  }
  picture.camera_group = json.At("camera_group").Integer(0, std::numeric_limits<int>::max());
  picture.time_s = OptionalNumber(json, "time_s", -kMaxNumber);
  const JsonReader notes = json.At("notes");
  for (std::size_t i = 0; i < notes.Size(); ++i) picture.notes.push_back(notes.At(i).String());
  return picture;
}

Frames ReadDocument(const JsonReader& json) {
  Frames frames;
  std::set<std::string> names;
  const JsonReader kept = json.At("kept"), dropped = json.At("dropped");
  for (std::size_t i = 0; i < kept.Size(); ++i) {
    frames.kept.push_back(ReadKept(kept.At(i)));
    if (!names.insert(frames.kept.back().name).second) kept.At(i).At("name").Fail("occurs twice");
  }
  for (std::size_t i = 0; i < dropped.Size(); ++i) {
    frames.dropped.push_back({dropped.At(i).At("source").String(), dropped.At(i).At("reason").String()});
  }
  return frames;
}

}  // namespace

void WriteFrames(const fs::path& path, const Frames& frames) {
  Json json = {{"kept", Json::array()}, {"dropped", Json::array()}};
  for (const KeptPicture& picture : frames.kept) {
    Json entry = {{"name", picture.name},
                  {"source", picture.source},
                  {"width", picture.width},
                  {"height", picture.height},
                  {"sharpness", picture.sharpness},
                  {"focal_px", nullptr},
                  {"camera_group", picture.camera_group},
                  {"notes", picture.notes}};
    if (picture.focal_px) entry["focal_px"] = *picture.focal_px;
    if (picture.has_mask) entry["mask"] = true;
    if (!picture.panorama.empty()) {
      entry["panorama"] = picture.panorama;
      entry["heading_deg"] = picture.heading_deg;
    }
    if (picture.time_s) entry["time_s"] = *picture.time_s;
    json["kept"].push_back(entry);
  }
  for (const DroppedPicture& picture : frames.dropped) {
    json["dropped"].push_back({{"source", picture.source}, {"reason", picture.reason}});
  }
  io::WriteFileAtomically(path, io::DumpJson(json, 1) + "\n");
}

Frames ReadFrames(const fs::path& path) {
  if (!fs::is_regular_file(path))
    throw Error(ExitCode::kBadInput, path.string() + ": no such file", "Run pipeline ingest first");
  try {
    return ReadDocument(JsonReader::ReadDocument(path));
  } catch (const Error& error) {
    throw Error(ExitCode::kBadInput, error.what(), "Run pipeline ingest again");
  }
}

}  // namespace pipeline
