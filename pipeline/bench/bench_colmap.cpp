#include "pipeline/bench/bench_colmap.h"

#include <algorithm>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/process/process.h"
#include "sfm/colmap/colmap_options.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// Against hanging; the slowest preset on 50 pictures was seen to take 18 minutes.
constexpr double kStepLimitS = 6 * 3600;
constexpr int kLogLines = 8;

class ColmapRun {
 public:
  explicit ColmapRun(const fs::path& work) : work_(work), log_(work / "colmap.log") {
    const auto program = io::FindProgram("colmap");
    if (!program) {
      throw io::Error(io::ExitCode::kMissingTool, "colmap: not found on PATH", "Run: apt-get install colmap");
    }
    program_ = program->string();
    flags_ = sfm::ParseColmapHelp(Help("feature_extractor"), Help("mapper"));
  }

  const sfm::ColmapFlags& flags() const { return flags_; }
  std::string MatchingGpuFlag() const { return sfm::MatchingGpuFlag(Help("exhaustive_matcher")); }

  void Step(const std::string& command, const std::vector<std::string>& arguments, io::ResourceUse* use) {
    std::vector<std::string> argv = {program_, command, "--database_path", (work_ / "database.db").string()};
    argv.insert(argv.end(), arguments.begin(), arguments.end());
    const io::ProcessReport report =
        io::RunProcess(argv, {.timeout_s = kStepLimitS, .log_path = log_, .working_dir = work_});
    use->wall_s += report.wall_s;
    use->cpu_s += report.cpu_s;
    use->peak_rss_bytes = std::max(use->peak_rss_bytes, report.peak_rss_bytes);
    if (!report.Ok()) {
      throw io::Error(io::ExitCode::kMissingTool,
                      "colmap " + command + " failed; its last lines:\n" + io::LogTail(log_, kLogLines));
    }
  }

 private:
  std::string Help(const std::string& command) const {
    const fs::path log = work_ / (command + ".help");
    io::RunProcess({program_, command, "-h"}, {.log_path = log, .working_dir = work_});
    return io::ReadFile(log);
  }

  fs::path work_, log_;
  std::string program_;
  sfm::ColmapFlags flags_;
};

}  // namespace

std::vector<ColmapPreset> ColmapPresets() { return {{"COLMAP default"}, {"COLMAP fast", 2048, 1600}}; }

io::ColmapModel RunColmapPreset(const ColmapPreset& preset,
                                const fs::path& images,
                                bool single_camera,
                                const fs::path& work,
                                io::ResourceUse* use) {
  io::RecreateOwnedFolder(work);
  fs::create_directories(work / "sparse");
  ColmapRun colmap(work);
  std::vector<std::string> extraction = {"--image_path",
                                         images.string(),
                                         "--ImageReader.single_camera",
                                         single_camera ? "1" : "0",
                                         colmap.flags().extraction_use_gpu,
                                         "0"};
  if (preset.features > 0)
    extraction.insert(extraction.end(),
                      {colmap.flags().extraction_features, std::to_string(preset.features)});
  if (preset.size > 0)
    extraction.insert(extraction.end(), {colmap.flags().extraction_image_size, std::to_string(preset.size)});
  colmap.Step("feature_extractor", extraction, use);
  colmap.Step("exhaustive_matcher", {colmap.MatchingGpuFlag(), "0"}, use);
  colmap.Step("mapper", {"--image_path", images.string(), "--output_path", (work / "sparse").string()}, use);

  io::ColmapModel largest;
  for (const auto& entry : fs::directory_iterator(work / "sparse")) {
    io::ColmapModel model = io::ReadColmapModel(entry.path());
    if (model.scene.frames.size() > largest.scene.frames.size()) largest = std::move(model);
  }
  io::RemoveOwnedFolder(work);
  if (largest.scene.frames.empty())
    throw io::Error(io::ExitCode::kNotReconstructible, "colmap mapper: no model");
  return largest;
}

}  // namespace pipeline
