#include "pipeline/stage.h"

#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <new>
#include <nlohmann/json.hpp>
#include <thread>

#include "io/atomic_file.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/interrupt.h"
#include "io/progress.h"
#include "pipeline/run_record.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

const StageEntry& FindStage(const std::string& name) {
  const auto table = StageTable();
  return *std::find_if(
      table.begin(), table.end(), [&](const StageEntry& entry) { return entry.name == name; });
}

// Relative path -> content hash of every regular file below `path` (or of the file itself).
void HashTree(const fs::path& path, std::map<std::string, std::string>* hashes) {
  if (fs::is_directory(path)) {
    for (const auto& entry : fs::recursive_directory_iterator(path)) {
      if (entry.is_regular_file()) (*hashes)[entry.path().string()] = io::HashFile(entry.path());
    }
  } else if (fs::is_regular_file(path)) {
    (*hashes)[path.string()] = io::HashFile(path);
  } else {
    throw Error(ExitCode::kBadInput, path.string() + ": no such file or folder");
  }
}

bool OutputsIntact(const fs::path& folder, const Json& outputs) {
  for (const auto& [name, hash] : outputs.items()) {
    const fs::path file = folder / name;
    if (!fs::is_regular_file(file) || io::HashFile(file) != hash) return false;
  }
  return true;
}

}  // namespace

void AddCommonOptions(Options* options, CommonOptions* common) {
  options->Add("out", &common->out, "run folder", false);
  options->Add("threads", &common->threads, "worker threads; 0 = all cores", false);
  options->Add("force", &common->force, "run again even when nothing changed", false);
}

int ResolvedThreads(const CommonOptions& common) {
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return common.threads <= 0 ? cores : std::min(common.threads, 4 * cores);
}

StageRun::StageRun(const std::string& stage_name,
                   const CommonOptions& common,
                   const Options& options,
                   const std::vector<fs::path>& inputs,
                   bool keep_partial)
    : stage_name_(stage_name),
      options_json_(options.ResolvedJson()),
      start_(std::chrono::steady_clock::now()) {
  if (common.out.empty()) throw Error(ExitCode::kUsage, "pipeline " + stage_name + ": --out DIR is missing");
  run_folder_ = fs::absolute(common.out).lexically_normal();
  const std::string folder = FindStage(stage_name).folder;
  final_ = run_folder_ / folder;
  partial_ = run_folder_ / ("." + folder + ".partial");
  lock_ = std::make_unique<FolderLock>(run_folder_, "stage");

  for (const fs::path& input : inputs) HashTree(input, &input_hashes_);
  std::string key_text = stage_name + "\n" + VersionsJson() + "\n" + options.KeyText();
  for (const auto& [path, hash] : input_hashes_)
    key_text += "\n" + fs::path(path).lexically_relative(run_folder_).string() + " " + hash;
  key_ = io::HashBytes(key_text);

  const Json record = Json::parse(ReadStageRecord(run_folder_, stage_name), nullptr, false);
  if (!common.force && record.is_object() && record.value("key", "") == key_ && record.contains("outputs")) {
    up_to_date_ = OutputsIntact(final_, record["outputs"]);
  }
  if (up_to_date_) {
    std::fprintf(stderr, "%s: up to date\n", stage_name.c_str());
    return;
  }
  const fs::path key_file = partial_ / "key";
  const bool resumable =
      keep_partial && !common.force && fs::is_regular_file(key_file) && io::ReadFile(key_file) == key_;
  if (!resumable) {
    fs::remove_all(partial_);
    io::WriteFileAtomically(key_file, key_);
  }
  RecordStage(run_folder_, stage_name, R"({"status": "running"})");
}

StageRun::~StageRun() = default;

void StageRun::Decide(const std::string& line) {
  std::fprintf(stderr, "%s: %s\n", stage_name_.c_str(), line.c_str());
  decisions_.push_back(line);
}

void StageRun::Set(const std::string& key, double value) { SetJson(key, Json(value).dump()); }
void StageRun::Set(const std::string& key, const std::string& value) { SetJson(key, Json(value).dump()); }
void StageRun::SetJson(const std::string& key, const std::string& json_text) {
  figures_.emplace_back(key, json_text);
}

void StageRun::AddChildUse(double cpu_s, std::size_t peak_rss_bytes) {
  child_cpu_s_ += cpu_s;
  child_peak_rss_bytes_ = std::max(child_peak_rss_bytes_, peak_rss_bytes);
}

void StageRun::Finish() {
  fs::remove(partial_ / "key");
  std::map<std::string, std::string> output_hashes;
  HashTree(partial_, &output_hashes);
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();

  Json record;
  record["stage"] = stage_name_;
  record["status"] = "done";
  record["wall_s"] = wall_s;
  record["cpu_s"] = seconds(usage.ru_utime) + seconds(usage.ru_stime) + child_cpu_s_;
  record["peak_rss_bytes"] =
      std::max(static_cast<std::size_t>(usage.ru_maxrss) * 1024, child_peak_rss_bytes_);
  record["options"] = Json::parse(options_json_);
  record["versions"] = Json::parse(VersionsJson());
  record["decisions"] = decisions_;
  for (const auto& [key, text] : figures_) record[key] = Json::parse(text);
  record["key"] = key_;
  for (const auto& [path, hash] : input_hashes_)
    record["inputs"][fs::path(path).lexically_relative(run_folder_).string()] = hash;
  for (const auto& [path, hash] : output_hashes)
    record["outputs"][fs::path(path).lexically_relative(partial_).string()] = hash;

  const std::string folder = FindStage(stage_name_).folder;
  io::WriteFileAtomically(partial_ / (folder + ".json"), record.dump(1) + "\n");
  io::ReplaceFolder(partial_, final_);
  Json line = {{"status", "done"},
               {"wall_s", wall_s},
               {"cpu_s", record["cpu_s"]},
               {"peak_rss_bytes", record["peak_rss_bytes"]},
               {"key", key_}};
  for (const auto& [key, text] : figures_) {
    const Json value = Json::parse(text);
    if (value.is_number() || value.is_string()) line[key] = value;
  }
  RecordStage(run_folder_, stage_name_, line.dump());
  std::fprintf(stderr, "%s: done in %s\n", stage_name_.c_str(), io::FormatDuration(wall_s).c_str());
}

std::string ReadStageRecord(const fs::path& run_folder, const std::string& stage_name) {
  const std::string folder = FindStage(stage_name).folder;
  const fs::path path = run_folder / folder / (folder + ".json");
  return fs::is_regular_file(path) ? io::ReadFile(path) : "";
}

int GuardedMain(const std::string& program, const std::function<void()>& body) {
  const auto report = [&](ExitCode code, const std::string& what) {
    std::fprintf(stderr, "%s: error E%d: %s\n", program.c_str(), static_cast<int>(code), what.c_str());
    return static_cast<int>(code);
  };
  try {
    io::InstallInterruptHandlers();
    body();
    return static_cast<int>(ExitCode::kOk);
  } catch (const io::Interrupted& interrupted) {
    std::fprintf(stderr,
                 "%s: stopped by signal %d; the same command continues\n",
                 program.c_str(),
                 interrupted.signal());
    return 128 + interrupted.signal();
  } catch (const Error& error) {
    return report(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    return report(ExitCode::kNoResources, "out of memory. Use smaller pictures or fewer of them");
  } catch (const fs::filesystem_error& error) {
    return report(ExitCode::kNoResources, error.what());
  } catch (const std::exception& error) {
    return report(ExitCode::kInternal, std::string(error.what()) + ". Please report this as a bug");
  }
}

}  // namespace pipeline
