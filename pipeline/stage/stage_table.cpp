#include "pipeline/stage/stage_table.h"

#include <unistd.h>

#include <algorithm>

#include "io/base/check.h"
#include "io/base/error.h"

namespace pipeline {

std::span<const StageEntry> StageTable() {
  static constexpr StageEntry kTable[] = {
      {"ingest",
       "choose and clean the pictures of a folder, a glob or a video",
       "ingest",
       "INPUT",
       "ingest/images/ masks/ frames.json"},
      {"sfm",
       "find where each picture was taken",
       "sfm",
       "ingest/",
       "sfm/transforms.json points.ply sparse/",
       true},
      {"normalize",
       "move and scale the scene to near 2, far 6; split train and test",
       "scene",
       "sfm/",
       "scene/transforms_{train,test}.json scene.json"},
      {"train", "train the radiance field", "train", "scene/", "train/checkpoint.bin curve.csv", true},
      {"evaluate",
       "score held-out views: PSNR, SSIM, FLIP",
       "evaluate",
       "scene/ train/",
       "evaluate/metrics.json renders/ compare/",
       true},
      {"render", "render the novel-view film", "render", "scene/ train/", "render/novel_view.mp4", true},
      {"report",
       "write report.html and the page to look around in",
       "report",
       "all of the above",
       "report.html, scene.html"},
  };
  return kTable;
}

const StageEntry& FindStage(const std::string& name) {
  const auto table = StageTable();
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const StageEntry& entry) { return entry.name == name; });
  PIPELINE_CHECK(found != table.end());
  return *found;
}

std::filesystem::path ProgramOf(const std::string& name) {
  const std::filesystem::path program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / ("pipeline-" + name);
  if (access(program.c_str(), X_OK) != 0) {
    throw io::Error(io::ExitCode::kMissingTool,
                    program.string() + ": is missing",
                    "Build all targets; the stages stand beside `pipeline`");
  }
  return program;
}

}  // namespace pipeline
