#include "sfm/mapping/colmap.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <functional>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/parallel.h"
#include "io/base/process.h"
#include "io/base/progress.h"
#include "io/scene/colmap_model.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;

// Limits against hanging: ten times what the slowest supported machine was seen to need.
constexpr double kExtractionLimitS = 300, kExtractionLimitPerPictureS = 60;
constexpr double kVerifyingLimitS = 300, kVerifyingLimitPerPairS = 5;
constexpr double kMappingLimitS = 300, kMappingLimitPerPictureS = 20;
constexpr double kHelpLimitS = 60;
// COLMAP's threads reserve much more address space than they touch; this still stops a run-away reader.
constexpr std::size_t kMaxMemoryBytes = std::size_t{16} << 30;
// Pairs per process: about a second of work, so that progress shows. COLMAP draws its random samples per
// process, so this number is part of the result and must not depend on the machine.
constexpr std::size_t kPairsPerShard = 128;
constexpr int kLogLines = 8;

std::string Joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

std::string HelpText(const fs::path& program, const std::string& command, const fs::path& folder) {
  const fs::path log = folder / (command + ".help");
  const io::ProcessReport report = io::RunProcess(
      {program.string(), command, "-h"}, {.timeout_s = kHelpLimitS, .log_path = log, .working_dir = folder});
  const std::string text = io::ReadFile(log);
  fs::remove(log);
  if (report.signal != 0 || report.timed_out) {
    throw Error(ExitCode::kMissingTool,
                program.string() + ": '" + command + " -h' crashed",
                "Reinstall it (apt-get install --reinstall colmap)");
  }
  return text;
}

// Follows COLMAP's log and reports how many pictures a step has finished.
class LogProgress {
 public:
  LogProgress(const fs::path& log, const std::string& title, std::string marker, int done_before, int total)
      : log_(log),
        progress_(title),
        marker_(std::move(marker)),
        offset_(fs::exists(log) ? static_cast<std::streamoff>(fs::file_size(log)) : 0),
        done_(done_before),
        total_(total) {}

  void Tick() {
    std::ifstream in(log_);
    in.seekg(offset_);
    for (std::string line;
         std::getline(in, line) && !in.eof();) {  // a line without its end is read again later
      offset_ = in.tellg();
      done_ += line.find(marker_) != std::string::npos;
    }
    Show(std::min(0.99, static_cast<double>(done_) / std::max(1, total_)));
  }

  void Finish() {
    Tick();
    if (done_ >= total_) Show(1.0);
  }

 private:
  void Show(double fraction) { progress_.Update(fraction, fmt::format("{} of {}", done_, total_)); }

  fs::path log_;
  io::Progress progress_;
  std::string marker_;
  std::streamoff offset_;
  int done_, total_;
};

}  // namespace

struct Colmap::Step {
  std::string command;
  std::vector<std::string> arguments;
  fs::path log;
  double limit_s = 0;
  // The mapper exits with 1 when it finds no initial pair, and can start models over and over without end.
  bool may_find_nothing = false;
  std::function<void()> on_tick;
};

Colmap::Colmap(fs::path work_folder, int threads)
    : work_folder_(std::move(work_folder)),
      database_(work_folder_ / "database.db"),
      log_path_(work_folder_ / "colmap.log"),
      threads_(threads) {
  const auto program = io::FindProgram("colmap");
  if (!program)
    throw Error(ExitCode::kMissingTool, "colmap: not found on PATH", "Run: apt-get install colmap");
  program_ = *program;
  memory_bytes_ = std::min(
      kMaxMemoryBytes,
      static_cast<std::size_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)));
  fs::create_directories(work_folder_);
  flags_ = ParseColmapHelp(HelpText(program_, "feature_extractor", work_folder_),
                           HelpText(program_, "matches_importer", work_folder_),
                           HelpText(program_, "mapper", work_folder_));
}

bool Colmap::Run(const Step& step) {
  std::vector<std::string> argv = {program_.string(), step.command};
  argv.insert(argv.end(), step.arguments.begin(), step.arguments.end());
  const io::ProcessReport report = io::RunProcess(argv,
                                                  {.timeout_s = step.limit_s,
                                                   .memory_bytes = memory_bytes_,
                                                   .log_path = step.log,
                                                   .working_dir = work_folder_,
                                                   .on_tick = step.on_tick});
  {
    const std::lock_guard lock(mutex_);
    cpu_s_ += report.cpu_s;
    peak_rss_bytes_ = std::max(peak_rss_bytes_, report.peak_rss_bytes);
  }
  if (report.Ok()) return true;
  const std::string tail = io::LogTail(step.log, kLogLines);
  // Wrong options end with the same code as an empty result.
  const bool nothing = report.timed_out || (report.signal == 0 && report.exit_code == 1 &&
                                            tail.find("parse options") == std::string::npos);
  if (step.may_find_nothing && nothing) return false;
  const bool out_of_memory =
      !report.timed_out && (report.signal == SIGKILL || tail.find("bad_alloc") != std::string::npos);
  if (out_of_memory) {
    throw Error(ExitCode::kNoResources,
                fmt::format("colmap {} ran out of memory ({} GiB)", step.command, memory_bytes_ >> 30),
                "Use fewer --threads or smaller pictures (ingest --max-size)");
  }
  const std::string how = report.timed_out     ? "did not finish in " + io::FormatDuration(step.limit_s)
                          : report.signal != 0 ? fmt::format("crashed with signal {}", report.signal)
                                               : fmt::format("failed with exit code {}", report.exit_code);
  throw Error(ExitCode::kMissingTool,
              fmt::format("colmap {} {}; its last lines:\n{}", step.command, how, tail));
}

void Colmap::CreateDatabase(const fs::path& path) {
  fs::remove(path);
  Run({.command = "database_creator",
       .arguments = {"--database_path", path.string()},
       .log = log_path_,
       .limit_s = kHelpLimitS});
}

std::vector<Features> Colmap::ExtractFeatures(const fs::path& images_folder,
                                              const std::vector<CameraGroup>& groups,
                                              const std::vector<std::string>& names,
                                              const FeatureOptions& options) {
  int done = 0;
  const fs::path list_path = work_folder_ / "image_list.txt", database = work_folder_ / "features.db";
  for (const CameraGroup& group : groups) {
    io::WriteFileAtomically(list_path, Joined(group.names));
    LogProgress progress(
        log_path_, "sfm: features", "Processed file [", done, static_cast<int>(names.size()));
    const int longer = std::max(group.width, group.height);
    const int size = options.max_image_size > 0 ? std::min(longer, options.max_image_size) : longer;
    Run({.command = "feature_extractor",
         .arguments = {"--database_path",
                       database.string(),
                       "--image_path",
                       images_folder.string(),
                       "--image_list_path",
                       list_path.string(),
                       "--ImageReader.single_camera",
                       "1",
                       flags_.extraction_use_gpu,
                       "0",
                       flags_.extraction_threads,
                       std::to_string(threads_),
                       flags_.extraction_image_size,
                       std::to_string(size),
                       flags_.extraction_features,
                       std::to_string(options.max_features)},
         .log = log_path_,
         .limit_s = kExtractionLimitS + kExtractionLimitPerPictureS * static_cast<double>(group.names.size()),
         .on_tick = [&] { progress.Tick(); }});
    progress.Finish();
    done += static_cast<int>(group.names.size());
  }
  std::vector<Features> features = ReadFeatures(database, names);
  for (Features& picture : features) {  // COLMAP keeps all of the size at which it reaches the number
    if (picture.keypoints.size() <= static_cast<std::size_t>(options.max_features)) continue;
    picture = LargestFeatures(picture, options.max_features);
  }
  fs::remove(list_path);
  fs::remove(database);
  return features;
}

void Colmap::VerifyShard(const CapturedViews& views,
                         const std::vector<PairMatches>& shard,
                         std::size_t index) {
  const std::string stem = fmt::format("shard{}", index);
  const fs::path database = work_folder_ / (stem + ".db"), list = work_folder_ / (stem + ".txt"),
                 log = work_folder_ / (stem + ".log");
  CreateDatabase(database);
  WritePictures(database, views.groups, views.camera_model, views.names, views.features);
  WriteMatches(database, views.names, shard);
  std::vector<std::string> lines;
  for (const PairMatches& pair : shard) {
    lines.push_back(views.names[static_cast<std::size_t>(pair.a)] + " " +
                    views.names[static_cast<std::size_t>(pair.b)]);
  }
  io::WriteFileAtomically(list, Joined(lines));
  // Pairs whose matches are in the database are not matched again, only verified.
  Run({.command = "matches_importer",
       .arguments = {"--database_path",
                     database.string(),
                     "--match_list_path",
                     list.string(),
                     "--match_type",
                     "pairs",
                     flags_.matching_use_gpu,
                     "0",
                     flags_.matching_threads,
                     "1"},
       .log = log,
       .limit_s = kVerifyingLimitS + kVerifyingLimitPerPairS * static_cast<double>(shard.size())});
  fs::remove(list);
  fs::remove(log);
}

void Colmap::VerifyMatches(const CapturedViews& views, const std::vector<PairMatches>& matches) {
  std::vector<std::vector<PairMatches>> shards((matches.size() + kPairsPerShard - 1) / kPairsPerShard);
  for (std::size_t i = 0; i < matches.size(); ++i) shards[i / kPairsPerShard].push_back(matches[i]);
  io::Progress progress("sfm: verifying");
  std::size_t done = 0;
  io::ParallelFor(shards.size(), threads_, [&](std::size_t i) {
    VerifyShard(views, shards[i], i);
    const std::lock_guard lock(mutex_);
    ++done;
    progress.Update(static_cast<double>(done) / static_cast<double>(shards.size()),
                    fmt::format("{} pairs", matches.size()));
  });
  CreateDatabase(database_);
  WritePictures(database_, views.groups, views.camera_model, views.names, views.features);
  WriteMatches(database_, views.names, matches);
  for (std::size_t i = 0; i < shards.size(); ++i) {
    const fs::path shard = work_folder_ / fmt::format("shard{}.db", i);
    CopyGeometries(shard, database_);
    fs::remove(shard);
  }
}

Colmap::Step Colmap::MapperStep(const fs::path& images_folder, const fs::path& output, int n_pictures) const {
  fs::remove_all(output);
  fs::create_directories(output);
  Step step{.command = "mapper",
            .arguments = {"--database_path",
                          database_.string(),
                          "--image_path",  // must exist, even where no colours are read
                          (images_folder.empty() ? work_folder_ : images_folder).string(),
                          "--output_path",
                          output.string(),
                          "--Mapper.extract_colors",
                          images_folder.empty() ? "0" : "1",
                          flags_.mapper_threads,
                          "1"},
            .log = log_path_,
            .limit_s = kMappingLimitS + kMappingLimitPerPictureS * n_pictures,
            .may_find_nothing = true};
  step.arguments.insert(step.arguments.end(), flags_.mapper_options.begin(), flags_.mapper_options.end());
  return step;
}

std::vector<fs::path> Colmap::Map(const fs::path& images_folder, int n_pictures, bool relaxed) {
  const fs::path sparse = work_folder_ / "sparse";
  LogProgress progress(log_path_, "sfm: mapping", "Registering image #", 2, n_pictures);
  Step step = MapperStep(images_folder, sparse, n_pictures);
  step.on_tick = [&] { progress.Tick(); };
  if (relaxed) {
    // Half of COLMAP's defaults of 100 inliers, 16 degrees and 30 inliers.
    step.arguments.insert(step.arguments.end(),
                          {"--Mapper.init_min_num_inliers",
                           "50",
                           "--Mapper.init_min_tri_angle",
                           "8",
                           "--Mapper.abs_pose_min_num_inliers",
                           "15"});
  }
  Run(step);
  progress.Finish();
  std::vector<fs::path> models;
  for (const auto& entry : fs::directory_iterator(sparse)) {
    if (entry.is_directory()) models.push_back(entry.path());
  }
  std::sort(models.begin(), models.end());
  return models;
}

std::optional<fs::path> Colmap::Continue(const fs::path& images_folder,
                                         const fs::path& model,
                                         int n_pictures) {
  const fs::path output = work_folder_ / "continued";
  Step step = MapperStep(images_folder, output, n_pictures);
  // Half of COLMAP's evidence: poses are checked by the pairs afterwards. By its defaults a picture that does
  // not fit is tried 200 times over, and then as the start of other models.
  step.arguments.insert(step.arguments.end(),
                        {"--input_path",
                         model.string(),
                         "--Mapper.multiple_models",
                         "0",
                         "--Mapper.init_num_trials",
                         "1",
                         "--Mapper.abs_pose_min_num_inliers",
                         "15"});
  if (!Run(step) || !io::IsColmapModel(output)) return std::nullopt;
  return output;
}

std::optional<fs::path> Colmap::Merge(const fs::path& a, const fs::path& b) {
  const fs::path merged = work_folder_ / ("merged_" + a.filename().string() + "_" + b.filename().string());
  fs::create_directories(merged);
  const std::vector<std::string> arguments = {
      "--input_path1", a.string(), "--input_path2", b.string(), "--output_path", merged.string()};
  const bool ok = Run({.command = "model_merger",
                       .arguments = arguments,
                       .log = log_path_,
                       .limit_s = kMappingLimitS,
                       .may_find_nothing = true});
  if (!ok || !io::IsColmapModel(merged)) return std::nullopt;
  return merged;
}

}  // namespace sfm
