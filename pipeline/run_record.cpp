#include "pipeline/run_record.h"

#include <unistd.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "io/atomic_file.h"
#include "pipeline/stage.h"

namespace pipeline {

using Json = nlohmann::ordered_json;

std::string VersionsJson() {
  return Json{{"pipeline", PIPELINE_VERSION}, {"compiler", "g++ " __VERSION__}, {"opencv", OPENCV_VERSION}}
      .dump();
}

void RecordStage(const std::filesystem::path& run_folder,
                 const std::string& stage_name,
                 const std::string& entry_json) {
  const std::filesystem::path path = run_folder / "run.json";
  Json record;
  if (std::filesystem::is_regular_file(path)) record = Json::parse(io::ReadFile(path), nullptr, false);
  if (!record.is_object()) record = Json::object();
  char host[256] = "";
  gethostname(host, sizeof host - 1);
  record["versions"] = Json::parse(VersionsJson());
  record["host"] = {{"name", host}, {"cores", std::thread::hardware_concurrency()}};
  record["stages"][stage_name] = Json::parse(entry_json);
  io::WriteFileAtomically(path, record.dump(1) + "\n");
}

}  // namespace pipeline
