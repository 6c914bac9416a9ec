#include "pipeline/stage/run_record.h"

#include <unistd.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "io/base/atomic_file.h"
#include "io/base/json.h"
#include "pipeline/stage/folder_lock.h"
#include "pipeline/stage/stage_table.h"
#include "pipeline/stage/versions.h"

namespace pipeline {
namespace {

using io::Json;
namespace fs = std::filesystem;

// A damaged run.json is only a record: it is started anew.
Json ReadRecord(const fs::path& run_folder) {
  const fs::path path = run_folder / "run.json";
  Json record;
  if (fs::is_regular_file(path)) record = io::ParseJson(io::ReadFile(path));
  return record.is_object() ? record : Json::object();
}

void WriteRecord(const fs::path& run_folder, Json record) {
  char host[256] = "";
  gethostname(host, sizeof host - 1);
  record["versions"] = VersionsJson();
  record["host"] = {{"name", host}, {"cores", std::thread::hardware_concurrency()}};
  io::WriteFileAtomically(run_folder / "run.json", io::DumpJson(record, 1) + "\n");
}

}  // namespace

void RecordStage(const fs::path& run_folder, const std::string& stage_name, const Json& entry) {
  Json record = ReadRecord(run_folder);
  if (!record["stages"].is_object()) record["stages"] = Json::object();
  record["stages"][stage_name] = entry;
  WriteRecord(run_folder, std::move(record));
}

Json ReadStageEntry(const fs::path& run_folder, const std::string& stage_name) {
  const Json record = ReadRecord(run_folder);
  const auto stages = record.find("stages");
  if (stages == record.end() || !stages->is_object() || !stages->contains(stage_name)) return nullptr;
  return stages->at(stage_name);
}

void RecordRun(const fs::path& run_folder, const Json& members) {
  const FolderLock lock(run_folder, "stage");
  Json record = ReadRecord(run_folder);
  record.update(members);
  WriteRecord(run_folder, std::move(record));
}

Json ReadStageRecord(const fs::path& run_folder, const std::string& stage_name) {
  const std::string folder = FindStage(stage_name).folder;
  const fs::path path = run_folder / folder / (folder + ".json");
  Json record;
  if (fs::is_regular_file(path)) record = io::ParseJson(io::ReadFile(path));
  return record.is_object() ? record : Json();
}

double NumberAt(const Json& json, const char* key, double otherwise) {
  const auto it = json.find(key);
  return it != json.end() && it->is_number() ? it->get<double>() : otherwise;
}

std::string TextAt(const Json& json, const char* key) {
  const auto it = json.find(key);
  return it != json.end() && it->is_string() ? it->get<std::string>() : "";
}

}  // namespace pipeline
