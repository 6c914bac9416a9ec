#include "nerf/fields/checkpoint.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/base/json.h"
#include "io/base/memory.h"

namespace nerf {
namespace {

using io::Error;
using io::ExitCode;
using io::Json;

constexpr char kMagic[] = "NERFCKP8";
constexpr std::size_t kMagicSize = 8, kHashSize = 32, kPrefix = kMagicSize + 4 + kHashSize;
constexpr std::size_t kMaxHeader = 1 << 20;
constexpr std::size_t kMaxCameraValues = 1 << 24;
// Of a splat: place, scales, rotation, opacity, colours.
constexpr std::size_t kSplatBytes = (3 + 3 + 4 + 1 + 3 * kHarmonics) * sizeof(float);
constexpr std::size_t kMaxFile = std::size_t{8} << 30;
static_assert(std::endian::native == std::endian::little, "tensors are stored little endian");

// An array as it lies in the file.
struct Entry {
  std::string name;
  char* data;
  std::size_t bytes;
  std::string_view view() const { return {data, bytes}; }
};

std::vector<Entry> Entries(SceneField* scene_field, TrainState* state) {
  std::vector<Entry> entries;
  const auto add = [&](const std::string& name, auto values) {
    entries.push_back({name, reinterpret_cast<char*>(values.data()), values.size_bytes()});
  };
  const auto add_splats = [&](const std::string& name, Splats* splats) {
    add(name + "places", std::span(splats->places));
    add(name + "log_scales", std::span(splats->log_scales));
    add(name + "rotations", std::span(splats->rotations));
    add(name + "opacities", std::span(splats->opacities));
    add(name + "colours", std::span(splats->colours));
  };
  for (const Tensor& tensor : scene_field->field->State()) add(tensor.name, tensor.values);
  if (auto* hash = dynamic_cast<HashField*>(scene_field->field.get()))
    add("trained_cells", hash->trained_cells().times());
  add("occupancy", std::span(scene_field->grid.density()));
  // Rebuilt only every few steps, so not a function of the densities at this one.
  add("occupancy_distance", std::span(scene_field->grid.distance()));
  if (!state->cameras.empty()) add("cameras", std::span(state->cameras));
  if (!state->transients.shown.empty()) add("transients", std::span(state->transients.shown));
  if (scene_field->splats.size() > 0) add_splats("splat_", &scene_field->splats);
  if (!scene_field->splat_shares.empty()) add("splat_shares", std::span(scene_field->splat_shares.cells));
  if (SplatMoments& moments = state->splats.moments; !moments.empty()) {
    add("splat_sizes", std::span(moments.sizes));
    add_splats("splat_m_", &moments.m);
    add_splats("splat_v_", &moments.v);
  }
  return entries;
}

[[noreturn]] void Reject(const std::filesystem::path& path, const std::string& why) {
  throw Error(ExitCode::kBadState, path.string() + ": " + why, "Delete it and train again");
}

const Json& Member(const std::filesystem::path& path, const Json& json, const char* key) {
  const auto it = json.find(key);
  if (it == json.end()) Reject(path, std::string("header lacks ") + key);
  return *it;
}

template <typename T>
T Get(const std::filesystem::path& path, const Json& json, const char* key, T low, T high) {
  const auto it = json.find(key);
  if (it == json.end() || !it->is_number()) Reject(path, std::string("header lacks ") + key);
  const double value = it->get<double>();
  constexpr double kMaxWhole = 9007199254740992;  // 2^53: doubles hold whole numbers up to here
  const bool is_whole =
      it->is_number_integer() || (std::floor(value) == value && std::abs(value) <= kMaxWhole);
  if (std::is_integral_v<T> && !is_whole)
    Reject(path, std::string("header value of ") + key + " is not a whole number");
  if (!(value >= static_cast<double>(low) && value <= static_cast<double>(high))) {
    Reject(path, std::string("header value of ") + key + " is out of range");
  }
  return it->get<T>();
}

// Empty where there is no text of that name.
std::string TextIn(const Json& json, const char* key) {
  const auto it = json.find(key);
  return it != json.end() && it->is_string() ? it->get<std::string>() : "";
}

// A checkpoint's file. Tensors are read to where they belong: all of it would be in memory twice.
struct CheckpointFile {
  explicit CheckpointFile(const std::filesystem::path& path) {
    std::error_code error;
    errno = 0;
    in.open(path, std::ios::binary);
    if (!std::filesystem::is_regular_file(path, error) || !in) {
      io::ThrowIfMemoryWasRefused();
      throw Error(ExitCode::kBadInput, path.string() + ": no such file");
    }
    size = std::filesystem::file_size(path);
  }
  // The first bytes, at most `count`.
  std::string Start(std::size_t count) {
    std::string start(std::min<std::size_t>(count, size), '\0');
    in.read(start.data(), static_cast<std::streamsize>(start.size()));
    return start;
  }
  std::ifstream in;
  std::uintmax_t size = 0;
};

// Header of a checkpoint that begins with `file`, at least up to the header's end.
Json ParseHeader(const std::filesystem::path& path, const std::string& file, std::size_t* tensors_at) {
  if (file.size() < kPrefix || file.compare(0, kMagicSize, kMagic) != 0)
    Reject(path, "is not a checkpoint of this version");
  std::uint32_t length;
  std::memcpy(&length, file.data() + kMagicSize, 4);
  if (length > kMaxHeader || length > file.size() - kPrefix) Reject(path, "is cut off in its header");
  const std::string text = file.substr(kPrefix, length);
  if (file.compare(kMagicSize + 4, kHashSize, io::HashBytes(text)) != 0) Reject(path, "header hash differs");
  Json header = io::ParseJson(text);
  if (header.is_discarded() || !header.is_object()) Reject(path, "header is not JSON");
  *tensors_at = kPrefix + length;
  return header;
}

FieldKind KindIn(const std::filesystem::path& path, const Json& header) {
  const std::string name = TextIn(header, "field");
  const std::optional<FieldKind> kind = FieldKindOf(name);
  if (!kind) Reject(path, "holds a field of unknown kind '" + name + "'");
  return *kind;
}

std::unique_ptr<RadianceField> MakeField(const std::filesystem::path& path, const Json& header) {
  const Json& config = Member(path, header, "config");
  if (KindIn(path, header) == FieldKind::kHash) {
    return std::make_unique<HashField>(
        HashFieldOptions{.grid = {.n_levels = Get(path, config, "n_levels", 8, 8),
                                  .log2_hashmap_size = Get(path, config, "log2_hashmap_size", 1, 24),
                                  .base_resolution = Get(path, config, "base_resolution", 1, 1024),
                                  .finest_resolution = Get(path, config, "finest_resolution", 1, 1 << 20),
                                  .bf16 = Get(path, config, "bf16_table", 0, 1) == 1,
                                  .entry_moments = Get(path, config, "entry_moments", 0, 1) == 1},
                         .bf16_network = Get(path, config, "bf16_network", 0, 1) == 1},
        0);
  }
  FieldConfig values;
  if (config.is_object()) {
    for (const auto& [key, value] : config.items()) {
      if (value.is_number()) values[key] = value.get<double>();
    }
  }
  return std::make_unique<MlpField>(values);
}

// Makes room for the tensors as well, which a file of this size can hold.
void ReadSplatState(const std::filesystem::path& path,
                    const Json& header,
                    std::uintmax_t file_size,
                    SceneField* scene_field,
                    SplatState* state) {
  const auto number = Get<std::size_t>(path, header, "number", 0, file_size / kSplatBytes);
  scene_field->splats.resize(number);
  scene_field->splat_focal_px = Get(path, header, "focal_px", 1e-3f, 1e9f);
  state->step = Get<std::uint64_t>(path, header, "step", 0, ~0ull);
  state->error_ratio = Get(path, header, "error_ratio", 0.0, 1e12);
  scene_field->splat_share = Get(path, header, "share", 0.f, 1.f);
  scene_field->splat_share_behind =
      header.contains("share_behind") ? Get(path, header, "share_behind", 0.f, 1.f) : 0;
  if (header.contains("by_place") && Get(path, header, "by_place", 0, 1) == 1)
    scene_field->splat_shares.cells.resize(ShareMap::kCells);
  state->is_judged = Get(path, header, "judged", 0, 1) == 1;
  state->begin_s = Get(path, header, "begin_s", 0.0, 1e12);
  state->squared_error = Get(path, header, "squared_error", -1.0, 1e12);
  state->moments = {};
  if (Get(path, header, "unfinished", 0, 1) == 0) return;
  state->moments.sizes.resize(number);
  state->moments.m.resize(number), state->moments.v.resize(number);
}

}  // namespace

void WriteCheckpoint(const std::filesystem::path& path, SceneField* scene_field, const TrainState& state) {
  const SceneContraction& contraction = scene_field->contraction;
  const SamplerOptions& sampling = scene_field->sampler_options;
  Json header = Json::object();
  header["map"] = {{"x", contraction.centre[0]},
                   {"y", contraction.centre[1]},
                   {"z", contraction.centre[2]},
                   {"half", contraction.half},
                   {"unbounded", contraction.unbounded ? 1 : 0}};
  header["sampling"] = {{"near", sampling.near},
                        {"far", sampling.far},
                        {"step_size", sampling.step_size},
                        {"cone_angle", sampling.cone_angle},
                        {"scene_units", sampling.scene_units ? 1 : 0}};
  header["field"] = NameOf(scene_field->field->kind());
  header["config"] = scene_field->field->Config();
  if (const auto& background = scene_field->background)
    header["background"] = {{"r", (*background)[0]}, {"g", (*background)[1]}, {"b", (*background)[2]}};
  header["pixel_rays"] = scene_field->samples_per_pixel;
  if (scene_field->step_scale != 1) header["step_scale"] = scene_field->step_scale;
  header["grid_resolution"] = scene_field->grid.resolution();
  header["state"] = {{"seed", state.seed},
                     {"step", state.step},
                     {"budget_s", state.budget_s},
                     {"elapsed_s", state.elapsed_s},
                     {"n_rays", state.n_rays},
                     {"learning_rate_scale", state.learning_rate_scale},
                     {"skipped_steps", state.skipped_steps},
                     {"restarts", state.restarts},
                     {"squared_error", state.squared_error},
                     {"channels", state.channels},
                     {"field_s", state.field_s},
                     {"camera_values", state.cameras.size()}};
  if (state.transients.last_look > 0)
    header["transients"] = {{"pixels", state.transients.shown.size()},
                            {"last_look", state.transients.last_look}};
  header["splats"] = {{"number", scene_field->splats.size()},
                      {"focal_px", scene_field->splat_focal_px},
                      {"share", scene_field->splat_share},
                      {"share_behind", scene_field->splat_share_behind},
                      {"by_place", scene_field->splat_shares.empty() ? 0 : 1},
                      {"unfinished", state.splats.moments.empty() ? 0 : 1},
                      {"step", state.splats.step},
                      {"judged", state.splats.is_judged ? 1 : 0},
                      {"error_ratio", state.splats.error_ratio},
                      {"begin_s", state.splats.begin_s},
                      {"squared_error", state.splats.squared_error}};
  TrainState copy = state;  // that entries can refer to
  const std::vector<Entry> entries = Entries(scene_field, &copy);
  for (const Entry& entry : entries) {
    header["tensors"].push_back(
        {{"name", entry.name}, {"bytes", entry.bytes}, {"hash", io::HashBytes(entry.view())}});
  }
  const std::string text = io::DumpJson(header);
  const auto length = static_cast<std::uint32_t>(text.size());
  std::string start(kMagic, kMagicSize);
  start.append(reinterpret_cast<const char*>(&length), 4).append(io::HashBytes(text)).append(text);
  std::vector<std::string_view> parts = {start};
  for (const Entry& entry : entries) parts.push_back(entry.view());
  io::WriteFileAtomically(path, parts);
}

std::unique_ptr<SceneField> ReadCheckpoint(const std::filesystem::path& path, TrainState* state) {
  CheckpointFile file(path);
  if (file.size > kMaxFile)
    throw Error(ExitCode::kBadInput, path.string() + ": larger than " + std::to_string(kMaxFile) + " bytes");
  std::size_t at = 0;
  const Json header = ParseHeader(path, file.Start(kPrefix + kMaxHeader), &at);
  file.in.seekg(static_cast<std::streamoff>(at));
  const Json &m = Member(path, header, "map"), &s = Member(path, header, "sampling"),
             &t = Member(path, header, "state");
  constexpr float kHuge = 1e30f;
  SceneContraction contraction;
  contraction.centre = {
      Get(path, m, "x", -kHuge, kHuge), Get(path, m, "y", -kHuge, kHuge), Get(path, m, "z", -kHuge, kHuge)};
  contraction.half = Get(path, m, "half", 1e-30f, kHuge);
  contraction.unbounded = Get(path, m, "unbounded", 0, 1) == 1;
  const SamplerOptions sampling{.near = Get(path, s, "near", 0.f, kHuge),
                                .far = Get(path, s, "far", 0.f, kHuge),
                                .step_size = Get(path, s, "step_size", 1e-30f, kHuge),
                                .cone_angle = Get(path, s, "cone_angle", 0.f, kHuge),
                                .scene_units = Get(path, s, "scene_units", 0, 1) == 1};
  const int grid_resolution = Get(path, header, "grid_resolution", 64, 512);
  if (grid_resolution % 64 != 0) Reject(path, "header value of grid_resolution is not a multiple of 64");
  state->seed = Get<std::uint64_t>(path, t, "seed", 0, ~0ull);
  state->step = Get<std::uint64_t>(path, t, "step", 0, ~0ull);
  state->budget_s = Get(path, t, "budget_s", 0.0, 1e12);
  state->elapsed_s = Get(path, t, "elapsed_s", 0.0, 1e12);
  state->n_rays = Get(path, t, "n_rays", 1, 1 << 24);
  state->learning_rate_scale = Get(path, t, "learning_rate_scale", 0.0, 1.0);
  state->skipped_steps = Get(path, t, "skipped_steps", 0, 1 << 20);
  state->restarts = Get(path, t, "restarts", 0, 1 << 20);
  state->squared_error = Get(path, t, "squared_error", -1.0, 1e12);
  state->channels = Get(path, t, "channels", 3, 4);
  state->field_s = Get(path, t, "field_s", 0.0, 1e12);
  state->cameras.resize(Get<std::size_t>(path, t, "camera_values", 0, kMaxCameraValues));
  if (const auto it = header.find("transients"); it != header.end()) {
    state->transients.shown.resize(Get<std::size_t>(path, *it, "pixels", 0, file.size));
    state->transients.last_look = Get<std::uint64_t>(path, *it, "last_look", 1, ~0ull);
  } else {
    state->transients = {};
  }

  auto scene_field =
      std::make_unique<SceneField>(contraction, sampling, MakeField(path, header), grid_resolution);
  const int samples_per_pixel = Get(path, header, "pixel_rays", 1, 16);
  if (!IsSamplesPerPixel(samples_per_pixel))
    Reject(path, "header value of pixel_rays is not a square number");
  scene_field->samples_per_pixel = samples_per_pixel;
  if (header.contains("step_scale")) scene_field->step_scale = Get(path, header, "step_scale", 1e-3f, 1e3f);
  if (const auto it = header.find("background"); it != header.end()) {
    scene_field->background = {
        Get(path, *it, "r", 0.f, 1.f), Get(path, *it, "g", 0.f, 1.f), Get(path, *it, "b", 0.f, 1.f)};
  }
  ReadSplatState(path, Member(path, header, "splats"), file.size, scene_field.get(), &state->splats);
  std::size_t index = 0;
  const std::vector<Entry> entries = Entries(scene_field.get(), state);
  const Json& tensors = Member(path, header, "tensors");
  if (!tensors.is_array() || tensors.size() != entries.size()) Reject(path, "header lists other tensors");
  for (const Entry& entry : entries) {
    const Json& listed = tensors[index++];
    if (TextIn(listed, "name") != entry.name ||
        Get(path, listed, "bytes", std::size_t{0}, kMaxFile) != entry.bytes)
      Reject(path, "tensor " + entry.name + " has another size");
    if (file.size - at < entry.bytes) Reject(path, "is cut off in tensor " + entry.name);
    if (!file.in.read(entry.data, static_cast<std::streamsize>(entry.bytes)))
      throw Error(ExitCode::kBadInput, path.string() + ": cannot be read");
    if (TextIn(listed, "hash") != io::HashBytes(entry.view()))
      Reject(path, "hash of tensor " + entry.name + " differs");
    at += entry.bytes;
  }
  if (at != file.size) Reject(path, "has bytes after its last tensor");
  scene_field->field->Refresh();
  scene_field->grid.Refresh();
  return scene_field;
}

FieldKind KindOfCheckpoint(const std::filesystem::path& path) {
  std::size_t at = 0;
  return KindIn(path, ParseHeader(path, CheckpointFile(path).Start(kPrefix + kMaxHeader), &at));
}

}  // namespace nerf
