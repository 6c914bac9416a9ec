#include "pipeline/stage.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <new>
#include <nlohmann/json.hpp>
#include <thread>

#include "io/atomic_file.h"
#include "io/check.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/interrupt.h"
#include "io/owned_folder.h"
#include "io/progress.h"
#include "pipeline/run_record.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// File names need not be UTF-8; JSON must be.
std::string Dump(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

constexpr int kMaxThreadsPerCore = 4;  // more only costs memory

const StageEntry& FindStage(const std::string& name) {
  const auto table = StageTable();
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const StageEntry& entry) { return entry.name == name; });
  PIPELINE_CHECK(found != table.end());
  return *found;
}

// Path -> content hash of every regular file below `path` (or of the file itself), except below `skipped`.
void HashTree(const fs::path& path, const fs::path& skipped, std::map<std::string, std::string>* hashes) {
  const fs::path root = fs::absolute(path).lexically_normal();
  try {
    if (fs::is_regular_file(root)) (*hashes)[root.string()] = io::HashFile(root);
    if (!fs::is_directory(root)) return;
    for (auto it = fs::recursive_directory_iterator(root); it != fs::recursive_directory_iterator(); ++it) {
      if (it->is_directory() && it->path() == skipped) it.disable_recursion_pending();
      if (it->is_regular_file()) (*hashes)[it->path().string()] = io::HashFile(it->path());
    }
  } catch (const fs::filesystem_error& error) {
    throw Error(ExitCode::kBadInput, error.what());
  }
}

bool OutputsIntact(const fs::path& folder, const Json& record) {
  if (!record.contains("outputs")) return false;
  for (const auto& [name, hash] : record["outputs"].items()) {
    const fs::path file = folder / name;
    if (!fs::is_regular_file(file) || io::HashFile(file) != hash) return false;
  }
  return true;
}

// What run.json keeps of a stage's record: the figures, not the lists.
std::string Summary(const Json& record, const std::string& status) {
  Json line = {{"status", status}};
  for (const auto& [key, value] : record.items()) {
    if (key != "stage" && key != "status" && (value.is_number() || value.is_string())) line[key] = value;
  }
  return Dump(line);
}

}  // namespace

fs::path StageProgram(const std::string& stage_name) {
  const fs::path program = fs::read_symlink("/proc/self/exe").parent_path() /
                           (std::string("pipeline-") + FindStage(stage_name).name);
  if (access(program.c_str(), X_OK) != 0) {
    throw Error(ExitCode::kMissingTool,
                program.string() + ": is missing",
                "Build all targets; the stages stand beside `pipeline`");
  }
  return program;
}

void AddCommonOptions(Options* options, CommonOptions* common) {
  options->Add("out", &common->out, "run folder", false);
  options->Add("threads", &common->threads, "worker threads; 0 = all cores", false);
  options->Add("force", &common->force, "run again even when nothing changed", false);
}

int AvailableCores() {
  int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::ifstream cpu_max("/sys/fs/cgroup/cpu.max");  // "quota period" in microseconds, or "max period"
  double quota = 0, period = 0;
  if (cpu_max >> quota >> period && quota > 0 && period > 0)
    cores = std::clamp(static_cast<int>(std::ceil(quota / period)), 1, cores);
  return cores;
}

int ResolvedThreads(const CommonOptions& common) {
  const int cores = AvailableCores();
  return common.threads <= 0 ? cores : std::min(common.threads, kMaxThreadsPerCore * cores);
}

StageRun::StageRun(const std::string& stage_name,
                   const CommonOptions& common,
                   const Options& options,
                   const std::vector<fs::path>& inputs,
                   bool keep_partial)
    : stage_name_(stage_name), options_(options), start_(std::chrono::steady_clock::now()) {
  if (common.out.empty()) throw Error(ExitCode::kUsage, "pipeline " + stage_name + ": --out DIR is missing");
  run_folder_ = fs::absolute(common.out).lexically_normal();
  if (!run_folder_.has_filename()) run_folder_ = run_folder_.parent_path();  // "run/" is "run"
  const std::string folder = FindStage(stage_name).folder;
  final_ = run_folder_ / folder;
  partial_ = run_folder_ / ("." + folder + ".partial");
  key_file_ = run_folder_ / ("." + folder + ".key");
  for (const fs::path& input : inputs) {
    if (!fs::exists(input)) {
      throw Error(ExitCode::kBadInput,
                  input.string() + ": no such file or folder",
                  "Run the stages before `" + stage_name + "` first, or `pipeline run`");
    }
  }
  lock_ = std::make_unique<FolderLock>(run_folder_, "stage");
  io::RequireOwnedFolder(final_);  // now, not after the work

  for (const fs::path& input : inputs) HashTree(input, run_folder_, &input_hashes_);
  Json versions = Json::parse(VersionsJson());
  versions.erase("commit");  // says where results came from; whether they changed, the version says
  std::string key_text = stage_name + "\n" + versions.dump() + "\n" + options.KeyText();
  for (const auto& [path, hash] : input_hashes_)
    key_text += "\n" + fs::path(path).lexically_relative(run_folder_).string() + " " + hash;
  key_ = io::HashBytes(key_text);

  const Json record = Json::parse(ReadStageRecord(run_folder_, stage_name), nullptr, false);
  up_to_date_ = !common.force && record.is_object() && record.contains("key") && record["key"] == key_ &&
                OutputsIntact(final_, record);
  if (up_to_date_) {
    Record("done", record.dump());
    std::fprintf(stderr, "%s: up to date\n", stage_name.c_str());
  } else {
    OpenPartial(keep_partial && !common.force);
    Record("running", "{}");
  }
}

void StageRun::OpenPartial(bool keep_partial) {
  const bool resumable = keep_partial && fs::is_directory(partial_) && fs::is_regular_file(key_file_) &&
                         io::ReadFile(key_file_) == key_;
  if (!resumable) {
    fs::remove(key_file_);  // first: a half-removed folder must not look resumable
    io::RemoveOwnedFolder(partial_);
  }
  io::ClaimFolder(partial_);
  io::RemoveTemporaries(run_folder_);
  io::WriteFileAtomically(key_file_, key_);
}

StageRun::~StageRun() {
  if (up_to_date_ || finished_) return;
  try {
    Record(io::PendingInterrupt() ? "interrupted" : "failed", "{}");
  } catch (const std::exception&) {  // the error that brought us here is the one to report
  }
}

// run.json is rewritten only when the entry changes.
void StageRun::Record(const std::string& status, const std::string& record_json) {
  const std::string entry = Summary(Json::parse(record_json), status);
  if (ReadStageEntry(run_folder_, stage_name_) != entry) RecordStage(run_folder_, stage_name_, entry);
}

void StageRun::Decide(const std::string& line) {
  std::fprintf(stderr, "%s: %s\n", stage_name_.c_str(), line.c_str());
  decisions_.push_back(line);
}

void StageRun::Set(const std::string& key, double value) {
  PIPELINE_CHECK(std::isfinite(value));  // JSON would say null
  SetJson(key, Dump(value));
}
void StageRun::Set(const std::string& key, const std::string& value) { SetJson(key, Dump(value)); }
void StageRun::SetJson(const std::string& key, const std::string& json_text) {
  figures_.emplace_back(key, json_text);
}

void StageRun::AddChildUse(double cpu_s, std::size_t peak_rss_bytes) {
  child_cpu_s_ += cpu_s;
  child_peak_rss_bytes_ = std::max(child_peak_rss_bytes_, peak_rss_bytes);
}

void StageRun::Finish() {
  std::map<std::string, std::string> output_hashes;
  HashTree(partial_, {}, &output_hashes);
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
  record["options"] = Json::parse(options_.ResolvedJson());
  record["versions"] = Json::parse(VersionsJson());
  record["decisions"] = decisions_;
  for (const auto& [key, text] : figures_) record[key] = Json::parse(text);
  record["key"] = key_;
  record["inputs"] = Json::object();
  for (const auto& [path, hash] : input_hashes_)
    record["inputs"][fs::path(path).lexically_relative(run_folder_).string()] = hash;
  record["outputs"] = Json::object();
  for (const auto& [path, hash] : output_hashes)
    record["outputs"][fs::path(path).lexically_relative(partial_).string()] = hash;

  io::WriteFileAtomically(partial_ / (final_.filename().string() + ".json"), Dump(record, 1) + "\n");
  io::ReplaceFolder(partial_, final_);
  finished_ = true;
  fs::remove(key_file_);
  Record("done", Dump(record));
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
