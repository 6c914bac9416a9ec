#include "pipeline/stages/trained_scene.h"

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/base/json.h"
#include "io/scene/transforms.h"
#include "pipeline/stage/run_record.h"

namespace pipeline {
namespace {

using io::Json;
namespace fs = std::filesystem;

[[noreturn]] void Reject(const fs::path& path, const std::string& why) {
  throw io::Error(io::ExitCode::kBadState, path.string() + ": " + why, "Run pipeline train again");
}

// Hashes by name; an object without members where the record has none.
Json Hashes(const Json& record, const char* key) {
  const auto found = record.is_object() ? record.find(key) : record.end();
  return found != record.end() && found->is_object() ? *found : Json::object();
}

}  // namespace

void RequireTrainedOnThisScene(const StageRun& stage, const fs::path& checkpoint) {
  RequireTrainedOnThisScene(stage.run_folder(), stage.input_hashes(), checkpoint);
}

void RequireTrainedOnThisScene(const fs::path& run_folder,
                               const std::map<std::string, std::string>& input_hashes,
                               const fs::path& checkpoint) {
  const Json record = ReadStageRecord(run_folder, "train"), outputs = Hashes(record, "outputs");
  const auto recorded = outputs.find(checkpoint.filename().string());
  if (recorded == outputs.end() ||
      *recorded != input_hashes.at(fs::absolute(checkpoint).lexically_normal().string()))
    Reject(checkpoint, "is not the checkpoint that `train` wrote in this run folder");
  const Json inputs = Hashes(record, "inputs");
  for (const auto& [path, hash] : input_hashes) {
    const auto trained = inputs.find(fs::path(path).lexically_relative(run_folder).string());
    if (trained != inputs.end() && *trained != hash)
      Reject(path, "differs from what train/checkpoint.bin was trained on");
  }
}

fs::path TrainingMaskPath(const fs::path& train_folder, const io::Frame& frame) {
  return train_folder / "masks" / (frame.image_path.stem().string() + ".png");
}

io::Scene ReadTrainingScene(const fs::path& run_folder) {
  io::Scene scene = io::ReadTransforms(run_folder / "scene/transforms_train.json").scene;
  for (io::Frame& frame : scene.frames) {
    const fs::path mask = TrainingMaskPath(run_folder / "train", frame);
    if (fs::is_regular_file(mask)) frame.mask_path = mask;
  }
  return scene;
}

}  // namespace pipeline
