#include "sfm/colmap.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <functional>
#include <set>

#include "io/atomic_file.h"
#include "io/error.h"
#include "io/process.h"
#include "io/progress.h"
#include "sfm/colmap_database.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;
using io::Error;
using io::ExitCode;

// Limits against hanging: ten times what the slowest supported machine was seen to need.
constexpr double kExtractionLimitS = 300, kExtractionLimitPerPictureS = 60;
constexpr double kMatchingLimitS = 300, kMatchingLimitPerPairS = 20;
constexpr double kMappingLimitS = 1800, kMappingLimitPerPictureS = 60;
constexpr double kHelpLimitS = 60;
// COLMAP's threads reserve much more address space than they touch; this still stops a run-away reader.
constexpr std::size_t kMaxMemoryBytes = std::size_t{16} << 30;
// Pairs per call of the matcher: some seconds of work, so that progress shows and a ceiling can hold.
constexpr std::size_t kPairsPerCall = 100;
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

// Known focal length, principal point in the middle, no distortion, in the order of COLMAP's camera models.
std::string CameraParams(const CameraGroup& group, const std::string& model) {
  const std::string f = std::to_string(group.focal_px);
  const std::string focal = model == "PINHOLE" || model == "OPENCV" ? f + "," + f : f;
  const std::string distortion = model == "SIMPLE_RADIAL" ? ",0"
                                 : model == "RADIAL"      ? ",0,0"
                                 : model == "OPENCV"      ? ",0,0,0,0"
                                                          : "";
  return focal + "," + std::to_string(group.width / 2.0) + "," + std::to_string(group.height / 2.0) +
         distortion;
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
  void Show(double fraction) {
    progress_.Update(fraction, std::to_string(done_) + " of " + std::to_string(total_));
  }

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
  double limit_s = 0;
  bool limit_is_ceiling = false;        // running out of time is an answer, not a failure
  bool exit_one_means_nothing = false;  // the mapper's answer when it finds no initial pair
  std::function<void()> on_tick;
};

Colmap::Colmap(fs::path images_folder, fs::path work_folder, int threads)
    : images_folder_(std::move(images_folder)),
      work_folder_(std::move(work_folder)),
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
                                                   .log_path = log_path_,
                                                   .working_dir = work_folder_,
                                                   .on_tick = step.on_tick});
  cpu_s_ += report.cpu_s;
  peak_rss_bytes_ = std::max(peak_rss_bytes_, report.peak_rss_bytes);
  if (report.Ok()) return true;
  if (report.timed_out && step.limit_is_ceiling) return false;
  if (step.exit_one_means_nothing && report.signal == 0 && report.exit_code == 1) return false;
  const std::string tail = io::LogTail(log_path_, kLogLines);
  const bool out_of_memory =
      !report.timed_out && (report.signal == SIGKILL || tail.find("bad_alloc") != std::string::npos);
  if (out_of_memory) {
    throw Error(
        ExitCode::kNoResources,
        "colmap " + step.command + " ran out of memory (" + std::to_string(memory_bytes_ >> 30) + " GiB)",
        "Use fewer --threads or smaller pictures (ingest --max-size)");
  }
  const std::string how = report.timed_out     ? "did not finish in " + io::FormatDuration(step.limit_s)
                          : report.signal != 0 ? "crashed with signal " + std::to_string(report.signal)
                                               : "failed with exit code " + std::to_string(report.exit_code);
  throw Error(ExitCode::kMissingTool, "colmap " + step.command + " " + how + "; its last lines:\n" + tail);
}

void Colmap::ExtractFeatures(const std::vector<CameraGroup>& groups, const ExtractionOptions& options) {
  int total = 0, done = 0;
  for (const CameraGroup& group : groups) total += static_cast<int>(group.names.size());
  const fs::path list_path = work_folder_ / "image_list.txt";
  std::set<std::string> wanted;
  for (const CameraGroup& group : groups) {
    io::WriteFileAtomically(list_path, Joined(group.names));
    Step step{
        .command = "feature_extractor",
        .arguments = {"--database_path",
                      database_.string(),
                      "--image_path",
                      images_folder_.string(),
                      "--image_list_path",
                      list_path.string(),
                      "--ImageReader.single_camera",
                      "1",
                      "--ImageReader.camera_model",
                      options.camera_model,
                      flags_.extraction_use_gpu,
                      "0",
                      flags_.extraction_threads,
                      std::to_string(threads_),
                      flags_.extraction_image_size,
                      std::to_string(std::max(group.width, group.height)),
                      flags_.extraction_features,
                      std::to_string(options.max_features)},
        .limit_s = kExtractionLimitS + kExtractionLimitPerPictureS * static_cast<double>(group.names.size())};
    if (group.focal_px > 0) {
      step.arguments.push_back("--ImageReader.camera_params");
      step.arguments.push_back(CameraParams(group, options.camera_model));
    }
    LogProgress progress(log_path_, "sfm: features", "Processed file [", done, total);
    step.on_tick = [&] { progress.Tick(); };
    Run(step);
    progress.Finish();
    done += static_cast<int>(group.names.size());
    wanted.insert(group.names.begin(), group.names.end());
  }
  fs::remove(list_path);
  for (const PictureFeatures& picture : ReadFeatures(database_)) wanted.erase(picture.name);
  if (!wanted.empty()) {
    throw Error(ExitCode::kMissingTool,
                "colmap feature_extractor reported success but skipped " + std::to_string(wanted.size()) +
                    " pictures, first " + *wanted.begin() + "; its last lines:\n" +
                    io::LogTail(log_path_, kLogLines));
  }
}

bool Colmap::MatchPairs(const std::vector<std::string>& names, const ImagePairs& pairs, double max_seconds) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  const fs::path list_path = work_folder_ / "pair_list.txt";
  io::Progress progress("sfm: matching");
  std::size_t done = 0;
  for (auto next = pairs.begin(); next != pairs.end();) {
    std::vector<std::string> lines;
    for (; next != pairs.end() && lines.size() < kPairsPerCall; ++next) {
      lines.push_back(names[static_cast<std::size_t>(next->first)] + " " +
                      names[static_cast<std::size_t>(next->second)]);
    }
    io::WriteFileAtomically(list_path, Joined(lines));
    Step step{.command = "matches_importer",
              .arguments = {"--database_path",
                            database_.string(),
                            "--match_list_path",
                            list_path.string(),
                            "--match_type",
                            "pairs",
                            flags_.matching_use_gpu,
                            "0",
                            flags_.matching_threads,
                            std::to_string(threads_)},
              .limit_s = kMatchingLimitS + kMatchingLimitPerPairS * static_cast<double>(lines.size())};
    if (max_seconds > 0) {
      step.limit_s = max_seconds - std::chrono::duration<double>(Clock::now() - start).count();
      step.limit_is_ceiling = true;
      if (step.limit_s <= 0) return false;
    }
    const double fraction = static_cast<double>(done) / static_cast<double>(pairs.size());
    const std::string note = std::to_string(done) + " of " + std::to_string(pairs.size()) + " pairs";
    step.on_tick = [&] { progress.Update(fraction, note); };
    if (!Run(step)) return false;
    done += lines.size();
  }
  fs::remove(list_path);
  progress.Update(1.0, std::to_string(pairs.size()) + " pairs");
  return true;
}

std::vector<fs::path> Colmap::Map(int n_pictures) {
  const fs::path sparse = work_folder_ / "sparse";
  fs::remove_all(sparse);
  fs::create_directories(sparse);
  LogProgress progress(log_path_, "sfm: mapping", "Registering image #", 2, n_pictures);
  Run({.command = "mapper",
       .arguments = {"--database_path",
                     database_.string(),
                     "--image_path",
                     images_folder_.string(),
                     "--output_path",
                     sparse.string(),
                     flags_.mapper_threads,
                     std::to_string(threads_)},
       .limit_s = kMappingLimitS + kMappingLimitPerPictureS * n_pictures,
       .exit_one_means_nothing = true,
       .on_tick = [&] { progress.Tick(); }});
  progress.Finish();
  std::vector<fs::path> models;
  for (const auto& entry : fs::directory_iterator(sparse)) {
    if (entry.is_directory()) models.push_back(entry.path());
  }
  std::sort(models.begin(), models.end());
  return models;
}

}  // namespace sfm
