// What a run folder holds between stages: run.json, the record of a stage, frames.json.
#include <nlohmann/json.hpp>

#include "io/base/json.h"
#include "pipeline/stage/frames.h"
#include "pipeline/stage/run_record.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view file(reinterpret_cast<const char*>(data), size);
  const std::filesystem::path& run = fuzz::Folder();
  std::filesystem::create_directories(run / "train");
  fuzz::Write("train/train.json", file);
  fuzz::Write("run.json", file);
  const auto frames = fuzz::Write("frames.json", file);
  fuzz::MayRefuse([&] {
    const io::Json record = pipeline::ReadStageRecord(run, "train");
    pipeline::NumberAt(record, "wall_s");
    pipeline::TextAt(record, "status");
  });
  fuzz::MayRefuse([&] { pipeline::ReadStageEntry(run, "train"); });
  fuzz::MayRefuse([&] { pipeline::ReadFrames(frames); });
  return 0;
}
