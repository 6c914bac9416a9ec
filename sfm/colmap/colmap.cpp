#include "sfm/colmap/colmap.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/process/process.h"
#include "sfm/colmap/colmap_step.h"
#include "sfm/colmap/log_progress.h"
#include "sfm/features/shared_features.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;

// Limits against hanging: ten times what the slowest supported machine was seen to need.
constexpr double kExtractionLimitS = 300, kExtractionLimitPerPictureS = 60;
constexpr double kHelpLimitS = 60;
// COLMAP's threads reserve much more address space than they touch; this still stops a run-away reader.
constexpr std::size_t kMaxMemoryBytes = std::size_t{16} << 30;
constexpr int kLogLines = 8;
// COLMAP writes to the database when it opens it, and gives up at once when another process does at that
// moment.
constexpr const char* kLocked = "database is locked";
constexpr int kMostOpenings = 50;
// How point_triangulator aborts when no match makes a point.
constexpr const char* kNoPoints = "Check failed: bundle_adjuster.Solve";

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

}  // namespace

Colmap::Colmap(const fs::path& work_folder, int threads)
    : Colmap(work_folder, threads, work_folder / kDatabase) {}

Colmap::Colmap(fs::path work_folder, int threads, fs::path database)
    : work_folder_(std::move(work_folder)),
      database_(std::move(database)),
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
                           HelpText(program_, "mapper", work_folder_));
}

bool Colmap::Run(const Step& step) {
  // Its matrix library would share out products over all cores that it sees, and round otherwise on each
  // number of them.
  std::vector<std::string> argv = {"/usr/bin/env", "OMP_NUM_THREADS=1", program_.string(), step.command};
  argv.insert(argv.end(), step.arguments.begin(), step.arguments.end());
  io::ProcessReport report;
  std::string log;  // of this call
  const auto says = [&](const char* words) { return log.find(words) != std::string::npos; };
  bool locked = true;
  for (int i = 0; locked && i < kMostOpenings; ++i) {
    std::error_code no_log;
    const std::uintmax_t size = fs::file_size(step.log, no_log), begin = no_log ? 0 : size;
    report = io::RunProcess(argv,
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
    log = io::ReadFile(step.log);
    log.erase(0, begin);
    locked = says(kLocked);
  }
  const std::string tail = io::LogTail(step.log, kLogLines);
  // Wrong options end with the same code as an empty result.
  const bool nothing = report.timed_out || (report.signal == SIGABRT && says(kNoPoints)) ||
                       (report.signal == 0 && report.exit_code == 1 && !locked && !says("parse options"));
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
    LogProgress progress(log_path_, "features", "Processed file [", done, static_cast<int>(names.size()));
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

void Colmap::VerifyMatches(const CapturedViews& views, const std::vector<PairMatches>& matches) {
  const std::vector<TwoViewGeometry> geometries = VerifyOnAllRanks(views.features, matches, threads_);
  CreateDatabase(database_);
  WritePictures(database_, views.groups, views.camera_model, views.names, views.features);
  WriteMatches(database_, views.names, matches);
  WriteGeometries(database_, views.names, matches, geometries);
}

}  // namespace sfm
