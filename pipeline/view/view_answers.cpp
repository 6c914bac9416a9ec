#include "pipeline/view/view_answers.h"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "io/base/error.h"
#include "io/base/json.h"
#include "io/image/image.h"
#include "nerf/training/training_curve.h"
#include "pipeline/film/camera_path_file.h"
#include "pipeline/stages/training_watch.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Json;

// Of the time between two pictures while a hand moves, without and with a training beside them.
constexpr double kFrameBudget_ms = 80, kTrainingFrameBudget_ms = 160;
constexpr std::size_t kMaxViewerName = 64;

double ParseNumber(const std::string& name, std::string_view text, double min, double max) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= min && value <= max))
    throw io::Error(io::ExitCode::kBadInput, name + ": is missing or out of range");
  return value;
}

std::vector<double> ParseNumbers(const std::string& name, const std::string& text) {
  std::vector<double> numbers;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    numbers.push_back(ParseNumber(
        name, std::string_view(text).substr(begin, comma - begin), -io::kMaxCoordinate, io::kMaxCoordinate));
    begin = comma + 1;
  }
  return numbers;
}

ViewLayer ParseLayer(const std::string& text) {
  if (text == "colour") return ViewLayer::kColour;
  if (text == "depth") return ViewLayer::kDepth;
  if (text == "support") return ViewLayer::kSupport;
  throw io::Error(io::ExitCode::kBadInput, "layer: is not colour, depth or support");
}

Json CurveJson(const fs::path& path) {
  const nerf::CurveColumns curve = nerf::ReadTrainingCurve(path);
  Json rows = Json::array();
  for (std::size_t i = 0; i < curve.wall_s.size(); ++i)
    rows.push_back({curve.wall_s[i], curve.train_psnr[i], curve.heldout_psnr[i]});
  return rows;
}

}  // namespace

FrameRequest ParseFrameRequest(const Parameters& parameters) {
  const auto number = [&](const char* name, double min, double max) {
    return ParseNumber(name, parameters(name), min, max);
  };
  FrameRequest request;
  request.viewer = parameters("viewer").substr(0, kMaxViewerName);
  request.sequence = static_cast<std::uint64_t>(number("sequence", 0, 1e15));
  const int width = static_cast<int>(number("width", 8, kMaxViewSide)),
            height = static_cast<int>(number("height", 8, kMaxViewSide));
  if (width * height > kMaxViewPixels)
    throw io::Error(io::ExitCode::kBadInput, "width, height: more than a 4K picture");
  request.camera = nerf::CameraOfView(width, height, number("fov", kMinFov, kMaxFov));
  request.world_from_cam = PoseFromRows(ParseNumbers("pose", parameters("pose")), "pose");
  request.layer = ParseLayer(parameters("layer"));
  request.quality = static_cast<ViewQuality>(static_cast<int>(number("quality", 0, 2)));
  if (const std::string crop = parameters("crop"); !crop.empty()) request.crop = ParseCrop(crop, "crop");
  return request;
}

Json StateJson(const LiveRun& run) {
  const LiveRun::Content content = run.Now();
  const bool may_train = fs::is_directory(run.run_folder() / ".train.partial");
  std::optional<nerf::TrainingNews> news;
  if (may_train) {
    KeepWatching(run.run_folder());
    news = ReadTrainingNews(run.run_folder());
  }
  Json json = {{"version", content.version},
               {"shows",
                content.field   ? "field"
                : content.scene ? "points"
                                : "nothing"},
               {"finished", content.is_finished},
               {"support", content.support != nullptr},
               {"fault", content.fault},
               {"budget_ms", news ? kTrainingFrameBudget_ms : kFrameBudget_ms},
               {"training", nullptr},
               {"curve", CurveJson(run.CurvePath())}};
  if (news)
    json["training"] = {{"step", news->step},
                        {"progress", news->progress},
                        {"left_s", news->left_s},
                        {"train_psnr", news->train_psnr},
                        {"heldout_psnr", news->heldout_psnr}};
  return json;
}

std::vector<std::uint8_t> PhotoJpeg(const LiveRun::Content& content, const std::string& index) {
  const std::size_t n = content.scene ? content.scene->frames.size() : 0;
  const double number = ParseNumber("index", index, 0, static_cast<double>(n) - 1);
  const io::Image photo = io::ReadImage(content.scene->frames[static_cast<std::size_t>(number)].image_path);
  return io::EncodeImage(io::CompositeOn(photo, 255), ".jpg");
}

Json AnswerPath(const fs::path& run_folder, const std::string& body, bool save) {
  const CameraPathFile file = ParseCameraPath(body, "path");
  if (save) WriteCameraPath(run_folder / "camera_path.json", file);
  Json json = {{"frames", Json::array()}, {"saved", save}};
  for (const nerf::Keyframe& view : file.frames)
    json["frames"].push_back({{"pose", RowsOf(view.world_from_cam)}, {"fov", view.fov_y}});
  return json;
}

}  // namespace pipeline
