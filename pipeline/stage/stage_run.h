// One run of a stage: its cache key, its partial outputs, and their commit. A stage writes into a hidden
// partial folder that becomes `<run>/<folder>` only when it is complete. Of several ranks
// (io/process/ranks.h) the first does so; for the others a StageRun only tells whether and where there is
// work.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>
#include "io/base/json.h"

#include "io/process/stopwatch.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/folder_lock.h"

namespace pipeline {

class StageRun {
 public:
  // options must outlive the StageRun. inputs: files or folders whose content determines the result (folders
  // are walked; the run folder inside one is skipped). keep_partial: an interrupted run with the same key
  // left a folder to resume from; otherwise the partial folder starts empty. Throws kUsage on a rank whose
  // program, options or inputs are not those of rank 0.
  StageRun(const std::string& stage_name,
           const CommonOptions& common,
           const Options& options,
           const std::vector<std::filesystem::path>& inputs,
           bool keep_partial = false);
  ~StageRun();  // without Finish() the stage is recorded as failed or interrupted

  // False for ranks that only compute: they write no files but what they share in folder().
  bool Leads() const { return leads_; }
  // True when the finished outputs belong to this key and are intact: nothing to do.
  bool IsUpToDate() const { return up_to_date_; }
  const std::filesystem::path& folder() const { return partial_; }  // write here
  const std::filesystem::path& run_folder() const { return run_folder_; }
  // Content hash of a file that is one of the inputs.
  const std::string& InputHash(const std::filesystem::path& input) const;
  // Of all inputs, by absolute path.
  const std::map<std::string, std::string>& input_hashes() const { return input_hashes_; }

  // One line that says what was chosen and why; printed and recorded.
  void Decide(const std::string& line);
  void Set(const std::string& key, double value);  // finite
  void Set(const std::string& key, const std::string& value);
  void SetJson(const std::string& key, const io::Json& value);
  // Resource use of external programs, added to our own.
  void AddChildUse(double cpu_s, std::size_t peak_rss_bytes);

  // Writes the record, makes the outputs durable under their final name, adds a line to run.json.
  void Finish();

 private:
  void Follow(const std::string& origin);
  void OpenPartial(bool keep_partial);
  bool PartialHasKey() const;
  void RemovePartial();
  void Record(const std::string& status, const io::Json& record);

  std::string stage_name_, key_;
  const Options& options_;
  const bool leads_;
  std::filesystem::path run_folder_, partial_, final_, key_file_;
  std::unique_ptr<FolderLock> lock_;
  std::map<std::string, std::string> input_hashes_;
  std::vector<std::string> decisions_;
  std::unique_ptr<io::Json> figures_;  // an object of what was set
  io::Stopwatch stopwatch_;
  double child_cpu_s_ = 0;
  std::size_t child_peak_rss_bytes_ = 0;
  bool up_to_date_ = false, finished_ = false;
};

}  // namespace pipeline
