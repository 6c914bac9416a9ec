#include <cstdio>
#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/hash.h"
#include "io/base/json.h"
#include "io/base/quoting.h"
#include "nerf/rendering/trained_field.h"
#include "pipeline/report/report.h"
#include "pipeline/report/report_page.h"
#include "pipeline/report/scene_page.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/run_record.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stage/stage_table.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Json;

// Of report.html and scene.html with the pictures, films and tables that they hold.
constexpr std::size_t kPageBytes = std::size_t{96} << 20;

// Files that the page shows, as far as they exist.
std::vector<fs::path> ReportInputs(const fs::path& run_folder) {
  std::vector<fs::path> inputs;
  const auto add = [&](const fs::path& path) {
    if (fs::exists(run_folder / path)) inputs.push_back(run_folder / path);
  };
  for (const StageEntry& entry : StageTable()) {
    if (std::string(entry.name) != "report")
      add(fs::path(entry.folder) / (std::string(entry.folder) + ".json"));
  }
  for (const char* path : {"ingest/frames.json",
                           "scene/transforms_train.json",
                           "scene/transforms_test.json",
                           "scene/points.ply",
                           "train/curve.csv",
                           "train/checkpoint.bin",
                           "train/masks",
                           "evaluate/metrics.json",
                           "evaluate/compare",
                           "render/novel_view.mp4",
                           "render/depth.mp4",
                           "render/support",
                           "render/support.mp4",
                           "render/camera_path.json"}) {
    add(path);
  }
  return inputs;
}

// Of a file that may not be there.
std::string HashOf(const fs::path& path) { return fs::is_regular_file(path) ? io::HashFile(path) : ""; }

// Both pages lie outside the stage's folder; its record says which belong to it.
bool PagesAreIntact(const fs::path& run_folder, const fs::path& page) {
  const Json record = ReadStageRecord(run_folder, "report");
  return record.is_object() && TextAt(record, "page_hash") == HashOf(page) && fs::is_regular_file(page) &&
         TextAt(record, "scene_page_hash") == HashOf(ScenePagePath(run_folder));
}

void Report(CommonOptions common, const Options& bound) {
  const fs::path page_path = common.out / "report.html";
  if (!PagesAreIntact(common.out, page_path)) common.force = true;
  StageRun stage("report", common, bound, ReportInputs(common.out));
  if (stage.IsUpToDate()) return;
  ResolvedMemory(common).Require(nerf::LoadedFieldBytes(common.out / "train/checkpoint.bin") + kPageBytes,
                                 "report: the page of the field");
  const std::string scene_page = WriteScenePage(common.out);
  if (!scene_page.empty()) stage.Decide(scene_page);
  stage.Set("scene_page_hash", HashOf(ScenePagePath(common.out)));
  const std::string page = ReportPage(GatherReport(stage.run_folder()));
  io::WriteFileAtomically(page_path, page);
  stage.Set("page_hash", io::HashBytes(page));
  stage.Set("page_bytes", static_cast<double>(page.size()));
  const std::string shown = io::Printable(fs::absolute(page_path).lexically_normal().string());
  std::printf("report: %s\n", shown.c_str());
  stage.Finish();
}

}  // namespace

int RunReport(int argc, const char* const* argv) {
  return GuardedMain("pipeline report", [&] {
    CommonOptions common;
    Options bound(
        "pipeline report",
        "Writes report.html: film, unseen views, cameras and points, training curve, times, decisions; "
        "and scene.html, in which any browser looks around in the field.");
    AddCommonOptions(&bound, &common);
    if (bound.Parse(argc, argv)) Report(common, bound);
  });
}

}  // namespace pipeline
