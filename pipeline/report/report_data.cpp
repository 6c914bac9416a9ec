#include "pipeline/report/report_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/quoting.h"
#include "io/image/mask.h"
#include "io/scene/transforms.h"
#include "pipeline/report/scene_page.h"
#include "pipeline/stage/frames.h"
#include "pipeline/stage/run_record.h"
#include "pipeline/stage/stage_table.h"
#include "pipeline/stages/scene_record.h"
#include "pipeline/stages/trained_scene.h"

namespace pipeline {
namespace {

using io::Json;
namespace fs = std::filesystem;

// An empty object in place of anything else: the report leaves out what it cannot read.
Json ObjectOf(const Json& json) { return json.is_object() ? json : Json::object(); }

Json ReadObject(const fs::path& path) {
  return fs::is_regular_file(path) ? ObjectOf(io::ParseJson(io::ReadFile(path))) : Json::object();
}

// The members of an array that are objects.
std::vector<Json> ObjectsAt(const Json& json, const char* key) {
  std::vector<Json> objects;
  const auto it = json.find(key);
  if (it == json.end() || !it->is_array()) return objects;
  std::copy_if(
      it->begin(), it->end(), std::back_inserter(objects), [](const Json& j) { return j.is_object(); });
  return objects;
}

// The command that the resolved options of a record amount to: input, --out, and what the user set.
std::string CommandFromOptions(const std::string& command, const std::string& input, const Json& options) {
  std::string text = "pipeline " + command;
  if (!input.empty()) text += " " + io::ShellWord(input);
  for (const auto& [name, option] : options.items()) {
    if (name == "INPUT" || !option.is_object() || !option.contains("value")) continue;
    const std::string origin = TextAt(option, "origin");
    if (origin != "flag" && origin != "file") continue;
    const Json& value = option["value"];
    text += " " + io::ShellWord("--" + name + "=" +
                                (value.is_string() ? value.get<std::string>() : io::DumpJson(value)));
  }
  return text;
}

std::string InputOf(const Json& options) {
  const auto it = options.find("INPUT");
  return it != options.end() && it->is_object() ? TextAt(*it, "value") : "";
}

void GatherStages(const fs::path& run_folder, const Json& run, ReportData* data) {
  const Json commands = run.contains("commands") ? run["commands"] : Json::object();
  for (const StageEntry& entry : StageTable()) {
    if (std::string(entry.name) == "report") continue;
    StageSummary stage;
    stage.name = entry.name;
    stage.help = entry.help;
    const Json record = ObjectOf(ReadStageRecord(run_folder, entry.name));
    stage.done = TextAt(record, "status") == "done";
    stage.wall_s = NumberAt(record, "wall_s");
    stage.cpu_s = NumberAt(record, "cpu_s");
    stage.peak_rss_bytes = NumberAt(record, "peak_rss_bytes");
    if (record.contains("decisions") && record["decisions"].is_array()) {
      for (const Json& line : record["decisions"]) {
        if (line.is_string()) stage.decisions.push_back(line.get<std::string>());
      }
    }
    const Json options = record.contains("options") ? record["options"] : Json::object();
    stage.command = commands.is_object() ? TextAt(commands, entry.name) : "";
    if (stage.done && stage.command.empty()) {
      stage.command = CommandFromOptions(entry.name, InputOf(options), options);
    }
    if (data->input.empty()) data->input = InputOf(options);
    data->total_wall_s += stage.wall_s;
    data->stages.push_back(stage);
  }
}

void GatherPictures(const fs::path& run_folder, ReportData* data) {
  const fs::path frames_path = run_folder / "ingest" / "frames.json";
  data->has_ingest = fs::is_regular_file(frames_path);
  const Frames frames = data->has_ingest ? ReadFrames(frames_path) : Frames();
  for (const KeptPicture& kept : frames.kept) {
    std::string notes;
    for (const std::string& note : kept.notes) notes += (notes.empty() ? "" : "; ") + note;
    data->kept_pictures.push_back({kept.name, notes});
  }
  for (const DroppedPicture& dropped : frames.dropped)
    data->dropped_pictures.push_back({dropped.source, dropped.reason});
  data->kept = static_cast<int>(data->kept_pictures.size());
  data->dropped = static_cast<int>(data->dropped_pictures.size());

  const SceneRecord scene = ReadSceneRecord(run_folder);
  data->masks = scene.masks;
  data->used_share = scene.used_share;

  const Json sfm = ObjectOf(ReadStageRecord(run_folder, "sfm"));
  data->has_sfm = sfm.contains("registered");
  data->images = static_cast<int>(NumberAt(sfm, "images"));
  data->registered = static_cast<int>(NumberAt(sfm, "registered"));
  data->points = static_cast<int>(NumberAt(sfm, "points"));
  data->reprojection_error_px = NumberAt(sfm, "mean_reprojection_error_px");
  for (const Json& picture : ObjectsAt(sfm, "unregistered")) {
    data->unregistered.push_back({TextAt(picture, "name"), TextAt(picture, "cause")});
  }
  std::vector<Json> poses = ObjectsAt(sfm, "poses");
  std::stable_sort(poses.begin(), poses.end(), [](const Json& a, const Json& b) {
    return NumberAt(a, "rotation_sigma_deg") > NumberAt(b, "rotation_sigma_deg");
  });
  for (const Json& pose : poses) {
    data->pose_uncertainties.push_back(
        {TextAt(pose, "name"),
         fmt::format("rotation +- {:.4f} degrees, centre +- {:.3f} % of the cameras' extent",
                     NumberAt(pose, "rotation_sigma_deg"),
                     100 * NumberAt(pose, "centre_sigma_share"))});
  }
}

void GatherScores(const fs::path& run_folder, ReportData* data) {
  data->has_scores = fs::is_regular_file(run_folder / "evaluate" / "metrics.json");
  if (!data->has_scores) return;
  data->scores = ReadScores(run_folder / "evaluate");
  const int n_views = static_cast<int>(data->scores.views.size());
  for (const std::size_t view : data->scores.WorstFirst()) {
    const ViewScore& score = data->scores.views[view];
    const int rank = static_cast<int>(data->views.size()) + 1;
    const Comparison pictures = ComparisonPaths(run_folder / "evaluate", rank, n_views, score.name);
    data->views.push_back({.score = score});
    if (fs::is_regular_file(pictures.photo)) data->views.back().pictures = pictures;
  }
}

std::vector<LeftOut> GatherLeftOut(const fs::path& run_folder) {
  const fs::path transforms = run_folder / "scene/transforms_train.json";
  if (!fs::is_directory(run_folder / "train/masks") || !fs::is_regular_file(transforms)) return {};
  io::Scene scene = io::ReadTransforms(transforms).scene;
  std::vector<LeftOut> left_out;
  for (io::Frame& frame : scene.frames) {
    frame.mask_path = TrainingMaskPath(run_folder / "train", frame);
    if (!fs::is_regular_file(frame.mask_path)) continue;
    const io::Mask mask = io::MaskFromImage(io::ReadImage(frame.mask_path));
    const double used = static_cast<double>(mask.UsedCount()) / static_cast<double>(mask.used.size());
    left_out.push_back({frame, 1 - used});
  }
  std::stable_sort(
      left_out.begin(), left_out.end(), [](const LeftOut& a, const LeftOut& b) { return a.share > b.share; });
  return left_out;
}

}  // namespace

ReportData GatherReport(const fs::path& run_folder) {
  ReportData data;
  const Json run = ReadObject(run_folder / "run.json");
  data.input = TextAt(run, "input");
  if (!data.input.empty()) {
    data.run_command =
        CommandFromOptions("run", data.input, run.contains("options") ? run["options"] : Json::object());
  }
  if (run.contains("host")) {
    const Json& host = run["host"];
    data.host = fmt::format("{}, {:.0f} cores", TextAt(host, "name"), NumberAt(host, "cores"));
  }
  if (run.contains("versions") && run["versions"].is_object()) {
    for (const auto& [name, version] : run["versions"].items()) {
      if (version.is_string())
        data.versions += (data.versions.empty() ? "" : ", ") + name + " " + version.get<std::string>();
    }
  }
  GatherStages(run_folder, run, &data);
  fs::path named = data.input.empty() ? run_folder : fs::path(data.input);
  if (!named.has_filename()) named = named.parent_path();  // "photos/" is named photos
  data.name = named.filename().string();
  if (std::none_of(data.stages.begin(), data.stages.end(), [](const StageSummary& s) { return s.done; })) {
    throw io::Error(io::ExitCode::kBadInput,
                    run_folder.string() + ": holds no finished stage",
                    "Run `pipeline run INPUT --out " + run_folder.string() + "` first");
  }
  GatherPictures(run_folder, &data);
  const Json train = ObjectOf(ReadStageRecord(run_folder, "train"));
  data.field = TextAt(train, "field");
  data.train_s = NumberAt(train, "train_s");
  data.train_steps = NumberAt(train, "steps");
  data.train_parameters = NumberAt(train, "parameters");
  data.curve = nerf::ReadTrainingCurve(run_folder / "train" / "curve.csv");
  data.left_out = GatherLeftOut(run_folder);
  GatherScores(run_folder, &data);

  const Json render = ObjectOf(ReadStageRecord(run_folder, "render"));
  data.film_frames = static_cast<int>(NumberAt(render, "frames"));
  data.film_ms_per_frame = NumberAt(render, "ms_per_frame");
  const auto film = [&](const char* name) {
    const fs::path path = run_folder / "render" / name;
    return fs::is_regular_file(path) ? path : fs::path();
  };
  data.film = film("novel_view.mp4"), data.depth_film = film("depth.mp4");
  data.support_film = film("support.mp4");
  data.has_scene_page = fs::is_regular_file(ScenePagePath(run_folder));
  data.support = FindSupportPictures(run_folder / "render");
  data.scene_json = ScenePlotJson(run_folder);
  return data;
}

}  // namespace pipeline
