#include "pipeline/stages/trained_scene.h"

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "pipeline/stage/run_record.h"

namespace pipeline {
namespace {

using Json = nlohmann::ordered_json;

[[noreturn]] void Reject(const std::filesystem::path& path, const std::string& why) {
  throw io::Error(io::ExitCode::kBadState, path.string() + ": " + why, "Run pipeline train again");
}

// Hashes by name; an object without members where the record has none.
Json Hashes(const Json& record, const char* key) {
  const auto found = record.is_object() ? record.find(key) : record.end();
  return found != record.end() && found->is_object() ? *found : Json::object();
}

}  // namespace

void RequireTrainedOnThisScene(const StageRun& stage, const std::filesystem::path& checkpoint) {
  const std::filesystem::path& run = stage.run_folder();
  const Json record = ReadStageRecord(run, "train"), outputs = Hashes(record, "outputs");
  const auto recorded = outputs.find(checkpoint.filename().string());
  if (recorded == outputs.end() || *recorded != stage.InputHash(checkpoint))
    Reject(checkpoint, "is not the checkpoint that `train` wrote in this run folder");
  const Json inputs = Hashes(record, "inputs");
  for (const auto& [path, hash] : stage.input_hashes()) {
    const auto trained = inputs.find(std::filesystem::path(path).lexically_relative(run).string());
    if (trained != inputs.end() && *trained != hash)
      Reject(path, "differs from what train/checkpoint.bin was trained on");
  }
}

}  // namespace pipeline
