#include "nerf/checkpoint.h"

#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>

#include "io/atomic_file.h"
#include "io/error.h"
#include "io/hash.h"

namespace nerf {
namespace {

using io::Error;
using io::ExitCode;
using Json = nlohmann::json;

constexpr char kMagic[] = "NERFCKP1";
constexpr std::size_t kMagicSize = 8, kHashSize = 32, kPrefix = kMagicSize + 4 + kHashSize;
constexpr std::size_t kMaxHeader = 1 << 20;
constexpr std::size_t kMaxFile = std::size_t{8} << 30;
static_assert(std::endian::native == std::endian::little, "tensors are stored little endian");

std::vector<HashField::Tensor> Tensors(SceneField* scene_field) {
  std::vector<HashField::Tensor> tensors = scene_field->field.State();
  tensors.push_back({"occupancy", &scene_field->grid.density()});
  return tensors;
}

std::string_view Bytes(const std::vector<float>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

[[noreturn]] void Reject(const std::filesystem::path& path, const std::string& why) {
  throw Error(ExitCode::kBadState, path.string() + ": " + why, "Delete it and train again");
}

template <typename T>
T Get(const std::filesystem::path& path, const Json& json, const char* key, T low, T high) {
  const auto it = json.find(key);
  if (it == json.end() || !it->is_number()) Reject(path, std::string("header lacks ") + key);
  const double value = it->get<double>();
  if (!(value >= static_cast<double>(low) && value <= static_cast<double>(high))) {
    Reject(path, std::string("header value of ") + key + " is out of range");
  }
  return it->get<T>();
}

}  // namespace

void WriteCheckpoint(const std::filesystem::path& path, SceneField* scene_field, const TrainState& state) {
  const SpaceMap& map = scene_field->map;
  const SamplerOptions& sampling = scene_field->sampler_options;
  const HashFieldOptions& field = scene_field->field.options();
  Json header;
  header["map"] = {{"x", map.centre[0]},
                   {"y", map.centre[1]},
                   {"z", map.centre[2]},
                   {"half", map.half},
                   {"unbounded", map.unbounded ? 1 : 0}};
  header["sampling"] = {{"near", sampling.near},
                        {"far", sampling.far},
                        {"step_size", sampling.step_size},
                        {"cone_angle", sampling.cone_angle}};
  header["field"] = {{"n_levels", field.n_levels},
                     {"log2_hashmap_size", field.log2_hashmap_size},
                     {"base_resolution", field.base_resolution},
                     {"finest_resolution", field.finest_resolution}};
  header["grid_resolution"] = scene_field->grid.resolution();
  header["state"] = {{"seed", state.seed},
                     {"step", state.step},
                     {"elapsed_s", state.elapsed_s},
                     {"n_rays", state.n_rays},
                     {"learning_rate_scale", state.learning_rate_scale},
                     {"skipped_steps", state.skipped_steps},
                     {"restarts", state.restarts},
                     {"squared_error", state.squared_error},
                     {"channels", state.channels}};
  std::size_t size = kPrefix;
  for (const auto& tensor : Tensors(scene_field)) {
    header["tensors"].push_back({{"name", tensor.name},
                                 {"count", tensor.values->size()},
                                 {"hash", io::HashBytes(Bytes(*tensor.values))}});
    size += tensor.values->size() * sizeof(float);
  }
  const std::string text = header.dump();
  const auto length = static_cast<std::uint32_t>(text.size());
  std::string file;
  file.reserve(size + text.size());
  file.append(kMagic, kMagicSize)
      .append(reinterpret_cast<const char*>(&length), 4)
      .append(io::HashBytes(text))
      .append(text);
  for (const auto& tensor : Tensors(scene_field)) file.append(Bytes(*tensor.values));
  io::WriteFileAtomically(path, file);
}

std::unique_ptr<SceneField> ReadCheckpoint(const std::filesystem::path& path, TrainState* state) {
  const std::string file = io::ReadFile(path, kMaxFile);
  if (file.size() < kPrefix || file.compare(0, kMagicSize, kMagic) != 0)
    Reject(path, "is not a checkpoint of this version");
  std::uint32_t length;
  std::memcpy(&length, file.data() + kMagicSize, 4);
  if (length > kMaxHeader || length > file.size() - kPrefix) Reject(path, "is cut off in its header");
  const std::string text = file.substr(kPrefix, length);
  if (file.compare(kMagicSize + 4, kHashSize, io::HashBytes(text)) != 0) Reject(path, "header hash differs");
  const Json header = Json::parse(text, nullptr, false);
  if (header.is_discarded()) Reject(path, "header is not JSON");

  const Json &m = header["map"], &s = header["sampling"], &f = header["field"], &t = header["state"];
  constexpr float kHuge = 1e30f;
  SpaceMap map;
  map.centre = {
      Get(path, m, "x", -kHuge, kHuge), Get(path, m, "y", -kHuge, kHuge), Get(path, m, "z", -kHuge, kHuge)};
  map.half = Get(path, m, "half", 1e-30f, kHuge);
  map.unbounded = Get(path, m, "unbounded", 0, 1) == 1;
  const SamplerOptions sampling{.near = Get(path, s, "near", 0.f, kHuge),
                                .far = Get(path, s, "far", 0.f, kHuge),
                                .step_size = Get(path, s, "step_size", 1e-30f, kHuge),
                                .cone_angle = Get(path, s, "cone_angle", 0.f, kHuge)};
  const HashFieldOptions options{.n_levels = Get(path, f, "n_levels", 8, 8),
                                 .log2_hashmap_size = Get(path, f, "log2_hashmap_size", 1, 24),
                                 .base_resolution = Get(path, f, "base_resolution", 1, 1024),
                                 .finest_resolution = Get(path, f, "finest_resolution", 1, 1 << 20)};
  const int grid_resolution = Get(path, header, "grid_resolution", 64, 512);
  state->seed = Get<std::uint64_t>(path, t, "seed", 0, ~0ull);
  state->step = Get<std::uint64_t>(path, t, "step", 0, ~0ull);
  state->elapsed_s = Get(path, t, "elapsed_s", 0.0, 1e12);
  state->n_rays = Get(path, t, "n_rays", 1, 1 << 24);
  state->learning_rate_scale = Get(path, t, "learning_rate_scale", 0.0, 1.0);
  state->skipped_steps = Get(path, t, "skipped_steps", 0, 1 << 20);
  state->restarts = Get(path, t, "restarts", 0, 1 << 20);
  state->squared_error = Get(path, t, "squared_error", -1.0, 1e12);
  state->channels = Get(path, t, "channels", 3, 4);

  auto scene_field = std::make_unique<SceneField>(map, sampling, options, grid_resolution, 0);
  std::size_t at = kPrefix + length, index = 0;
  const auto tensors = Tensors(scene_field.get());
  if (!header["tensors"].is_array() || header["tensors"].size() != tensors.size())
    Reject(path, "header lists other tensors");
  for (const auto& tensor : tensors) {
    const Json& entry = header["tensors"][index++];
    const std::size_t bytes = tensor.values->size() * sizeof(float);
    if (entry.value("name", "") != tensor.name ||
        entry.value("count", std::size_t{0}) != tensor.values->size()) {
      Reject(path, std::string("tensor ") + tensor.name + " has another size");
    }
    if (file.size() - at < bytes) Reject(path, std::string("is cut off in tensor ") + tensor.name);
    std::memcpy(tensor.values->data(), file.data() + at, bytes);
    if (entry.value("hash", "") != io::HashBytes(Bytes(*tensor.values)))
      Reject(path, std::string("hash of tensor ") + tensor.name + " differs");
    at += bytes;
  }
  if (at != file.size()) Reject(path, "has bytes after its last tensor");
  scene_field->field.RefreshTransposes();
  scene_field->grid.Rebuild();
  return scene_field;
}

}  // namespace nerf
