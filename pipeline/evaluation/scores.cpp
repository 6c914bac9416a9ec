#include "pipeline/evaluation/scores.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>

#include "io/base/atomic_file.h"
#include "io/base/json.h"
#include "io/base/json_reader.h"
#include "nerf/metrics/flip.h"
#include "nerf/metrics/metrics.h"

namespace pipeline {
namespace {

using io::Json;
using io::JsonReader;
namespace fs = std::filesystem;

constexpr char kOnWhite[] = "white, straight alpha composited before scoring";

// RFC 4180: a name is quoted, and its quotes are doubled.
std::string CsvLine(const ViewScore& view) {
  std::string line = "\"";
  for (const char c : view.name) line += c == '"' ? std::string("\"\"") : std::string(1, c);
  return line +
         fmt::format(
             "\",{:.4f},{:.6f},{:.6f},{:.4f}\n", view.psnr_db, view.ssim, view.flip, view.aligned_psnr_db);
}

double NumberAt(const JsonReader& json, const char* key) {
  constexpr double kMax = std::numeric_limits<double>::max();
  return json.At(key).Number(-kMax, kMax);
}

bool FlagAt(const JsonReader& json, const char* key) { return json.Has(key) && json.At(key).Bool(); }

void WriteBudget(const std::optional<ErrorBudget>& budget, Json* json) {
  if (!budget) return;
  for (const auto& [name, value] : kErrorBudgetFields) (*json)["error_budget"][name] = *budget.*value;
}

std::optional<ErrorBudget> ReadBudget(const JsonReader& json) {
  if (!json.Has("error_budget")) return std::nullopt;
  ErrorBudget budget;
  for (const auto& [name, value] : kErrorBudgetFields)
    budget.*value = NumberAt(json.At("error_budget"), name);
  return budget;
}

}  // namespace

std::vector<std::size_t> Scores::WorstFirst() const {
  std::vector<std::size_t> order(views.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return views[a].psnr_db < views[b].psnr_db;
  });
  return order;
}

void WriteScores(const Scores& scores, const fs::path& folder) {
  Json json = Json::object();
  json["protocol"] = scores.protocol;
  json["resolution"] = {scores.width, scores.height};
  json["background"] = scores.white_background ? kOnWhite : "none";
  if (scores.masked) {
    json["masked"] = true;
    json["pixels"] = "those that the masks use; of SSIM and FLIP, values at their place";
  }
  json["rounding"] = "8-bit sRGB, nearest, both pictures";
  json["ssim_kernel"] =
      "11x11 Gaussian, sigma 1.5, valid region, mean of channels, k1 0.01, k2 0.03, data range 1";
  json["flip_pixels_per_degree"] = nerf::FlipOptions().pixels_per_degree;
  json["psnr_cap_db"] = nerf::kMaxPsnrDb;
  json["psnr"] = scores.psnr_db;
  json["ssim"] = scores.ssim;
  json["flip"] = scores.flip;
  json["psnr_of_mean_mse"] = scores.psnr_of_mean_mse_db;
  json["colour_aligned_psnr"] = scores.aligned_psnr_db;
  if (scores.training_psnr_db) json["training_psnr_median"] = *scores.training_psnr_db;
  if (scores.plain_psnr_db) json["one_colour_psnr_median"] = *scores.plain_psnr_db;
  if (scores.hidden_points) json["hidden_points_median"] = *scores.hidden_points;
  WriteBudget(scores.budget, &json);
  std::string csv = "name,psnr,ssim,flip,colour_aligned_psnr\n";
  for (const ViewScore& view : scores.views) {
    Json entry = {{"name", view.name},
                  {"psnr", view.psnr_db},
                  {"ssim", view.ssim},
                  {"flip", view.flip},
                  {"colour_aligned_psnr", view.aligned_psnr_db}};
    if (view.identical) entry["identical"] = true;
    WriteBudget(view.budget, &entry);
    json["images"].push_back(entry);
    csv += CsvLine(view);
  }
  io::WriteFileAtomically(folder / "metrics.json", io::DumpJson(json, 1) + "\n");
  io::WriteFileAtomically(folder / "per_image.csv", csv);
}

Scores ReadScores(const fs::path& folder) {
  const JsonReader json = JsonReader::ReadDocument(folder / "metrics.json");
  Scores scores;
  scores.protocol = json.At("protocol").String();
  scores.width = json.At("resolution").At(0).Integer(1, std::numeric_limits<int>::max());
  scores.height = json.At("resolution").At(1).Integer(1, std::numeric_limits<int>::max());
  scores.white_background = json.At("background").String() == kOnWhite;
  scores.masked = FlagAt(json, "masked");
  scores.psnr_db = NumberAt(json, "psnr");
  scores.ssim = NumberAt(json, "ssim");
  scores.flip = NumberAt(json, "flip");
  scores.psnr_of_mean_mse_db = NumberAt(json, "psnr_of_mean_mse");
  scores.aligned_psnr_db = NumberAt(json, "colour_aligned_psnr");
  if (json.Has("training_psnr_median")) scores.training_psnr_db = NumberAt(json, "training_psnr_median");
  if (json.Has("one_colour_psnr_median")) scores.plain_psnr_db = NumberAt(json, "one_colour_psnr_median");
  if (json.Has("hidden_points_median")) scores.hidden_points = NumberAt(json, "hidden_points_median");
  scores.budget = ReadBudget(json);
  const JsonReader views = json.At("images");
  for (std::size_t i = 0; i < views.Size(); ++i) {
    const JsonReader view = views.At(i);
    scores.views.push_back({.name = view.At("name").String(),
                            .psnr_db = NumberAt(view, "psnr"),
                            .ssim = NumberAt(view, "ssim"),
                            .flip = NumberAt(view, "flip"),
                            .aligned_psnr_db = NumberAt(view, "colour_aligned_psnr"),
                            .identical = FlagAt(view, "identical"),
                            .budget = ReadBudget(view)});
  }
  return scores;
}

}  // namespace pipeline
