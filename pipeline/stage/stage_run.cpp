#include "pipeline/stage/stage_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/base/atomic_file.h"
#include "io/base/check.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/base/json.h"
#include "io/base/owned_folder.h"
#include "io/base/quoting.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "io/process/ranks.h"
#include "io/process/resource_meter.h"
#include "pipeline/stage/hash_tree.h"
#include "pipeline/stage/run_record.h"
#include "pipeline/stage/stage_table.h"
#include "pipeline/stage/versions.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
using io::Json;
namespace fs = std::filesystem;

// File names need not be UTF-8; JSON must be.

// Of all members of a record but the hash itself.
std::string HashOfRecord(Json record) {
  record.erase("record_hash");
  return io::HashBytes(io::DumpJson(record, 1));
}

// The record and the files that it lists are as the stage wrote them.
bool ProductsIntact(const fs::path& folder, const Json& record) {
  if (TextAt(record, "record_hash") != HashOfRecord(record) || !record.contains("outputs")) return false;
  for (const auto& [name, hash] : record["outputs"].items()) {
    const fs::path file = folder / name;
    if (!fs::is_regular_file(file) || io::HashFile(file) != hash) return false;
  }
  return true;
}

// What run.json keeps of a stage's record: the figures, not the lists.
Json Summary(const Json& record, const std::string& status) {
  Json line = {{"status", status}};
  for (const auto& [key, value] : record.items()) {
    if (key != "stage" && key != "status" && (value.is_number() || value.is_string())) line[key] = value;
  }
  return line;
}

}  // namespace

StageRun::StageRun(const std::string& stage_name,
                   const CommonOptions& common,
                   const Options& options,
                   const std::vector<fs::path>& inputs,
                   bool keep_partial)
    : stage_name_(stage_name),
      options_(options),
      leads_(io::AllRanks().IsFirst()),
      figures_(std::make_unique<Json>(Json::object())) {
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
  if (leads_) {
    lock_ = std::make_unique<FolderLock>(run_folder_, "stage");
    io::RequireOwnedFolder(final_);  // now, not after the work
  }
  for (const fs::path& input : inputs) HashTree(input, run_folder_, &input_hashes_);
  Json versions = VersionsJson();
  versions.erase("commit");  // says where results came from; whether they changed, the version says
  std::string key_text = stage_name + "\n" + io::DumpJson(versions) + "\n" + options.KeyText();
  for (const auto& [path, hash] : input_hashes_)
    key_text += "\n" + fs::path(path).lexically_relative(run_folder_).string() + " " + hash;
  key_ = io::HashBytes(key_text);
  const std::string origin = io::DumpJson(VersionsJson()) + "\n" + key_text;
  if (!leads_) {
    Follow(origin);
    io::FromFirst(true);  // the folder is there
    return;
  }

  const Json record = ReadStageRecord(run_folder_, stage_name);
  up_to_date_ = !common.force && TextAt(record, "key") == key_ && ProductsIntact(final_, record);
  std::string told = (up_to_date_ ? "1" : "0") + origin;
  io::AllRanks().Broadcast(&told);
  io::RemoveTemporaries(run_folder_);
  if (up_to_date_) {
    // A run that was killed right after its commit. Another one, to be resumed with other options, stays.
    if (PartialHasKey()) RemovePartial();
    Record("done", record);
    std::fprintf(stderr, "%s: up to date\n", stage_name.c_str());
  } else {
    OpenPartial(keep_partial && !common.force);
    Record("running", Json::object());
  }
  io::FromFirst(true);
}

// Rank 0 does what concerns files; all others must be about to compute the same.
void StageRun::Follow(const std::string& origin) {
  std::string told;
  io::AllRanks().Broadcast(&told);
  up_to_date_ = told.starts_with("1");
  std::istringstream theirs(told.substr(1)), mine(origin);
  for (std::string a, b; theirs || mine; a.clear(), b.clear()) {
    std::getline(theirs, a), std::getline(mine, b);
    if (a == b) continue;
    throw Error(ExitCode::kUsage,
                fmt::format("rank {} differs from rank 0: {} instead of {}",
                            io::AllRanks().rank(),
                            b.empty() ? "nothing" : b,
                            a.empty() ? "nothing" : a),
                "Start all ranks with the same program, options and run folder");
  }
}

const std::string& StageRun::InputHash(const fs::path& input) const {
  const auto found = input_hashes_.find(fs::absolute(input).lexically_normal().string());
  PIPELINE_CHECK(found != input_hashes_.end());
  return found->second;
}

void StageRun::OpenPartial(bool keep_partial) {
  if (!keep_partial || !fs::is_directory(partial_) || !PartialHasKey()) RemovePartial();
  io::ClaimFolder(partial_);
  io::WriteFileAtomically(key_file_, key_);
}

bool StageRun::PartialHasKey() const {
  return fs::is_regular_file(key_file_) && io::ReadFile(key_file_) == key_;
}

void StageRun::RemovePartial() {
  fs::remove(key_file_);  // first: a half-removed folder must not look resumable
  io::RemoveOwnedFolder(partial_);
}

StageRun::~StageRun() {
  if (!leads_ || up_to_date_ || finished_) return;
  try {
    Record(io::PendingInterrupt() ? "interrupted" : "failed", Json::object());
  } catch (const std::exception&) {  // the error that brought us here is the one to report
  }
}

// run.json is rewritten only when the entry changes.
void StageRun::Record(const std::string& status, const Json& record) {
  const Json entry = Summary(record, status);
  if (ReadStageEntry(run_folder_, stage_name_) != entry) RecordStage(run_folder_, stage_name_, entry);
}

void StageRun::Decide(const std::string& line) {
  if (!leads_) return;
  std::fprintf(stderr, "%s: %s\n", stage_name_.c_str(), io::Printable(line).c_str());
  decisions_.push_back(line);
}

void StageRun::Set(const std::string& key, double value) {
  PIPELINE_CHECK(std::isfinite(value));  // JSON would say null
  (*figures_)[key] = value;
}
void StageRun::Set(const std::string& key, const std::string& value) { (*figures_)[key] = value; }
void StageRun::SetJson(const std::string& key, const Json& value) { (*figures_)[key] = value; }

void StageRun::AddChildUse(double cpu_s, std::size_t peak_rss_bytes) {
  child_cpu_s_ += cpu_s;
  child_peak_rss_bytes_ = std::max(child_peak_rss_bytes_, peak_rss_bytes);
}

void StageRun::Finish() {
  if (!leads_) return;
  std::map<std::string, std::string> output_hashes;
  HashTree(partial_, {}, &output_hashes);
  const double wall_s = stopwatch_.seconds();

  Json record = Json::object();
  record["stage"] = stage_name_;
  record["status"] = "done";
  record["wall_s"] = wall_s;
  record["cpu_s"] = io::ProcessCpuSeconds() + child_cpu_s_;
  record["peak_rss_bytes"] = std::max(io::PeakRssBytes(), child_peak_rss_bytes_);
  record["options"] = options_.ResolvedJson();
  record["versions"] = VersionsJson();
  record["decisions"] = decisions_;
  record.update(*figures_);
  record["key"] = key_;
  record["inputs"] = Json::object();
  for (const auto& [path, hash] : input_hashes_)
    record["inputs"][fs::path(path).lexically_relative(run_folder_).string()] = hash;
  record["outputs"] = Json::object();
  for (const auto& [path, hash] : output_hashes)
    record["outputs"][fs::path(path).lexically_relative(partial_).string()] = hash;
  record["record_hash"] = HashOfRecord(record);

  io::WriteFileAtomically(partial_ / (final_.filename().string() + ".json"), io::DumpJson(record, 1) + "\n");
  io::ReplaceFolder(partial_, final_);
  finished_ = true;
  fs::remove(key_file_);
  Record("done", record);
  std::fprintf(stderr, "%s: done in %s\n", stage_name_.c_str(), io::FormatDuration(wall_s).c_str());
}

}  // namespace pipeline
