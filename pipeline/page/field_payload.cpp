#include "pipeline/page/field_payload.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/base/check.h"
#include "io/base/json.h"
#include "nerf/rendering/splat_mixing.h"
#include "nerf/rendering/trained_field.h"
#include "pipeline/film/film.h"
#include "pipeline/page/splat_payload.h"

namespace pipeline {
namespace {

using io::Json;
using nerf::HashField;
using nerf::kernels::GridLevel;

using Network = nerf::HashNetwork<float>;
constexpr std::size_t kInputs = Network::kInputs, kHidden = Network::kHidden, kOutputs = Network::kOutputs,
                      kFeatures = nerf::kernels::kFeatures;
// Shown where pictures with alpha left the background open, as RenderOptions::background.
constexpr std::array<float, 3> kWhite = {1, 1, 1};

std::span<const float> TensorOf(HashField* field, const std::string& name) {
  for (const nerf::Tensor& tensor : field->State())
    if (tensor.name == name) return tensor.values;
  PIPELINE_CHECK(false);
  return {};
}

// Matrix [rows][columns] as blocks of 4 x 4, row of blocks by row: the columns of a block, one per input,
// hold what that input gives to four outputs.
void AppendBlocks(std::span<const float> matrix,
                  std::size_t rows,
                  std::size_t columns,
                  std::vector<float>* to) {
  for (std::size_t row = 0; row < rows; row += 4)
    for (std::size_t column = 0; column < columns; column += 4)
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 4; ++j) to->push_back(matrix[(row + i) * columns + column + j]);
}

// In the order of the uniform blocks of field.glsl.
std::vector<float> ShaderWeights(std::span<const float> weights) {
  std::vector<float> out;
  AppendBlocks(weights.subspan(Network::kW1), kInputs, kHidden, &out);
  for (std::size_t i = 0; i < kHidden; ++i) out.push_back(weights[Network::kW2 + i * kOutputs]);
  AppendBlocks(weights.subspan(Network::kW2), kHidden, kOutputs, &out);
  AppendBlocks(weights.subspan(Network::kW3), kInputs, kHidden, &out);
  for (std::size_t i = 0; i < kHidden; ++i) {
    for (std::size_t j = 0; j < 3; ++j) out.push_back(weights[Network::kW5 + j * kHidden + i]);
    out.push_back(0);
  }
  AppendBlocks(weights.subspan(Network::kW4), kHidden, kHidden, &out);
  return out;
}

std::vector<std::uint8_t> MarchCells(const nerf::OccupancyGrid& grid) {
  const nerf::kernels::OccupancyBlocks blocks = grid.Blocks();
  const std::uint32_t n = blocks.resolution, n_blocks = n / 4;
  std::vector<std::uint8_t> cells;
  cells.reserve(grid.n_cells());
  for (std::uint32_t z = 0; z < n; ++z) {
    for (std::uint32_t y = 0; y < n; ++y) {
      for (std::uint32_t x = 0; x < n; ++x) {
        const std::uint32_t block = (z / 4 * n_blocks + y / 4) * n_blocks + x / 4;
        const std::uint32_t bit = (z % 4 * 4 + y % 4) * 4 + x % 4;
        const std::uint8_t distance = blocks.distance[block];
        const bool occupied = distance == 0 && (blocks.cells[block] >> bit & 1) == 1;
        cells.push_back(occupied ? 0 : std::max<std::uint8_t>(distance, 1));
      }
    }
  }
  return cells;
}

std::vector<std::uint8_t> TrainedBytes(const nerf::TrainedCells& trained) {
  constexpr std::size_t n = nerf::TrainedCells::kResolution;
  std::vector<std::uint8_t> cells;
  cells.reserve(n * n * n);
  const auto centre = [](std::size_t i) {
    return (static_cast<float>(i) + 0.5f) / static_cast<float>(nerf::TrainedCells::kResolution);
  };
  for (std::size_t z = 0; z < n; ++z)
    for (std::size_t y = 0; y < n; ++y)
      for (std::size_t x = 0; x < n; ++x)
        cells.push_back(trained.Contains(centre(x), centre(y), centre(z)) ? 255
                        : trained.IsNear(centre(x), centre(y), centre(z)) ? 128
                                                                          : 0);
  return cells;
}

// Adds a part to the bytes and says where it lies.
template <typename T>
void AppendPart(const char* name, const std::vector<T>& values, Json* json, std::string* bytes) {
  const std::size_t size = values.size() * sizeof(T);
  (*json)["parts"][name] = {bytes->size(), size};
  bytes->append(reinterpret_cast<const char*>(values.data()), size);
}

// Levels that count everywhere, see DropUntrained in hash_field.cpp: all before the first hashed one, and
// always the coarsest.
std::size_t KeptLevels(const std::vector<GridLevel>& levels) {
  const auto hashed =
      std::find_if(levels.begin(), levels.end(), [](const GridLevel& level) { return level.hash_mask != 0; });
  return std::max<std::size_t>(1, static_cast<std::size_t>(hashed - levels.begin()));
}

Json SpaceJson(const nerf::SceneField& scene_field, bool has_alpha) {
  const nerf::SceneContraction& map = scene_field.contraction;
  const nerf::SamplerOptions& sampling = scene_field.sampler_options;
  return {{"centre", map.centre},
          {"half", map.half},
          {"unbounded", map.unbounded},
          {"ends_at_infinity", scene_field.EndsAtInfinity()},
          {"near", sampling.near},
          {"far", sampling.far},
          {"step_size", sampling.step_size},
          {"cone_angle", sampling.cone_angle},
          {"step_scale", nerf::FinestStepScale(scene_field.samples_per_pixel)},
          {"rays_per_pixel", scene_field.samples_per_pixel},
          {"background", scene_field.Background(has_alpha, kWhite)},
          {"has_unknown_space", !has_alpha && !scene_field.background},
          {"unseen", kUnseenTone}};
}

std::vector<std::uint8_t> ShareTexels(const nerf::SceneField& scene_field) {
  if (!scene_field.splat_shares.empty()) return scene_field.splat_shares.cells;
  return {static_cast<std::uint8_t>(std::lround(255 * scene_field.splat_share))};
}

// Constants of the shader, and how splats and field are mixed.
Json SplatsJson(const nerf::SceneField& scene_field, const SplatPayload& payload) {
  return {{"share", scene_field.splat_share},
          {"share_behind", scene_field.splat_share_behind},
          {"nearly_as_far", nerf::kNearlyAsFar},
          {"well_before", nerf::kWellBefore},
          {"shares_resolution", scene_field.splat_shares.empty() ? 1 : nerf::ShareMap::kResolution},
          {"focal_px", scene_field.splat_focal_px},
          {"low_pass", nerf::kLowPass},
          {"slope_margin", nerf::kSlopeMargin},
          {"nearest", nerf::kNearestSplat},
          {"constants",
           {{"NEAREST", nerf::kNearestSplat},
            {"MIN_ALPHA", nerf::kernels::kMinSplatAlpha},
            {"MAX_ALPHA", nerf::kernels::kMaxSplatAlpha},
            {"HARMONIC0", nerf::kHarmonic0},
            {"HARMONIC1", nerf::kHarmonic1},
            {"LOWEST_SCALE", payload.lowest_scale},
            {"SCALE_STEP", payload.scale_step},
            {"COLOUR0", payload.colour_steps[0]},
            {"COLOUR1", payload.colour_steps[1]}}}};
}

}  // namespace

QuantizedLevel QuantizeLevel(std::span<const float> features) {
  QuantizedLevel level = {.texels = {}, .scale = {}};
  for (std::size_t i = 0; i < features.size(); ++i)
    level.scale[i % kFeatures] = std::max(level.scale[i % kFeatures], std::fabs(features[i]));
  level.texels.reserve(features.size());
  for (std::size_t i = 0; i < features.size(); ++i) {
    const float scale = level.scale[i % kFeatures];
    const float root = scale > 0 ? std::sqrt(std::fabs(features[i]) / scale) : 0;
    const long value = 128 + std::lround(std::copysign(127 * root, features[i]));
    level.texels.push_back(static_cast<std::uint8_t>(value));
  }
  return level;
}

FieldPayload MakeFieldPayload(nerf::SceneField* scene_field, bool has_alpha) {
  auto* field = dynamic_cast<HashField*>(scene_field->field.get());
  PIPELINE_CHECK(field != nullptr);
  Json json = {{"space", SpaceJson(*scene_field, has_alpha)},
               {"grid_resolution", scene_field->grid.resolution()},
               {"trained_resolution", nerf::TrainedCells::kResolution},
               {"kept_levels", KeptLevels(field->grid().levels())}};
  const std::span<const float> table = TensorOf(field, "table");
  std::vector<std::uint8_t> texels;
  texels.reserve(table.size());
  for (const GridLevel& level : field->grid().levels()) {
    const QuantizedLevel quantized =
        QuantizeLevel(table.subspan(level.first_entry * kFeatures, level.n_entries * kFeatures));
    texels.insert(texels.end(), quantized.texels.begin(), quantized.texels.end());
    json["levels"].push_back({{"resolution", level.resolution},
                              {"hash_mask", level.hash_mask},
                              {"first_entry", level.first_entry},
                              {"scale", quantized.scale}});
  }
  FieldPayload payload;
  AppendPart("weights", ShaderWeights(TensorOf(field, "weights")), &json, &payload.bytes);
  if (scene_field->splats.size() > 0) {
    const SplatPayload splats = MakeSplatPayload(scene_field->splats);
    json["splats"] = SplatsJson(*scene_field, splats);
    AppendPart("splats", splats.words, &json, &payload.bytes);
    AppendPart("shares", ShareTexels(*scene_field), &json, &payload.bytes);
  }
  AppendPart("table", texels, &json, &payload.bytes);
  AppendPart("march", MarchCells(scene_field->grid), &json, &payload.bytes);
  AppendPart("trained", TrainedBytes(field->trained_cells()), &json, &payload.bytes);
  payload.description = io::DumpJson(json);
  return payload;
}

}  // namespace pipeline
