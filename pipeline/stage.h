// What every stage shares: its row in the stage table, the lock on the run folder, the cache key, and the
// commit of its outputs. A stage writes into a hidden partial folder that becomes `<run>/<folder>` only when
// it is complete.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "pipeline/options.h"

namespace pipeline {

struct StageEntry {
  const char* name;
  const char* help;
  const char* folder;  // output folder inside the run folder; its record is <folder>/<folder>.json
  const char* inputs;  // for --help and README
  const char* outputs;
  int (*run)(int argc, const char* const* argv);
};

// ingest, sfm, normalize, train, evaluate, render, report, in this order.
std::span<const StageEntry> StageTable();

// Absolute path of `pipeline-<stage>` beside the running executable. Throws kMissingTool when it is not
// there.
std::filesystem::path StageProgram(const std::string& stage_name);

// Options every stage has.
struct CommonOptions {
  std::filesystem::path out;  // run folder
  bool force = false;         // run even when nothing changed
  int threads = 0;            // 0: all cores
};
void AddCommonOptions(Options* options, CommonOptions* common);
// Cores this process may use: its affinity, and the CPU quota of its container.
int AvailableCores();
// common.threads, or all available cores; never more than kMaxThreadsPerCore per core.
int ResolvedThreads(const CommonOptions& common);

// Held while a process works in a run folder, which it makes ours (io/owned_folder.h); the kernel frees it
// when the owner dies. Throws kLocked naming the owner.
class FolderLock {
 public:
  FolderLock(const std::filesystem::path& run_folder, const std::string& name);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_ = -1;
};

class StageRun {
 public:
  // options must outlive the StageRun. inputs: files or folders whose content determines the result (folders
  // are walked; the run folder inside one is skipped). keep_partial: an interrupted run with the same key
  // left a folder to resume from; otherwise the partial folder starts empty.
  StageRun(const std::string& stage_name,
           const CommonOptions& common,
           const Options& options,
           const std::vector<std::filesystem::path>& inputs,
           bool keep_partial = false);
  ~StageRun();  // without Finish() the stage is recorded as failed or interrupted

  // True when the finished outputs belong to this key and are intact: nothing to do.
  bool IsUpToDate() const { return up_to_date_; }
  const std::filesystem::path& folder() const { return partial_; }  // write here
  const std::filesystem::path& run_folder() const { return run_folder_; }

  // One line that says what was chosen and why; printed and recorded.
  void Decide(const std::string& line);
  void Set(const std::string& key, double value);  // finite
  void Set(const std::string& key, const std::string& value);
  void SetJson(const std::string& key, const std::string& json_text);
  // Resource use of external programs, added to our own.
  void AddChildUse(double cpu_s, std::size_t peak_rss_bytes);

  // Writes the record, makes the outputs durable under their final name, adds a line to run.json.
  void Finish();

 private:
  void OpenPartial(bool keep_partial);
  void Record(const std::string& status, const std::string& record_json);

  std::string stage_name_, key_;
  const Options& options_;
  std::filesystem::path run_folder_, partial_, final_, key_file_;
  std::unique_ptr<FolderLock> lock_;
  std::map<std::string, std::string> input_hashes_;
  std::vector<std::string> decisions_;
  std::vector<std::pair<std::string, std::string>> figures_;  // key, JSON text
  std::chrono::steady_clock::time_point start_;
  double child_cpu_s_ = 0;
  std::size_t child_peak_rss_bytes_ = 0;
  bool up_to_date_ = false, finished_ = false;
};

// Runs a body with the project's error policy: one line on stderr and the documented exit code.
int GuardedMain(const std::string& program, const std::function<void()>& body);

// The record <run>/<folder>/<folder>.json as JSON text; empty when absent.
std::string ReadStageRecord(const std::filesystem::path& run_folder, const std::string& stage_name);

// Code version, compiler and library versions as JSON text.
std::string VersionsJson();

}  // namespace pipeline
