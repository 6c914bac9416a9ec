#include "pipeline/ingest/ingest.h"

#include <algorithm>
#include <iterator>

#include "io/base/error.h"
#include "pipeline/ingest/ingest_options.h"
#include "pipeline/ingest/photo_masks.h"
#include "pipeline/ingest/run_input.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
namespace fs = std::filesystem;

std::vector<fs::path> MasksOf(const PictureSource& source, const fs::path& folder) {
  if (source.is_video) {
    throw Error(ExitCode::kUsage,
                "--masks: the frames of a video have no names that masks could bear",
                "Extract them with ffmpeg, and give their folder and the masks");
  }
  return MatchMasks(folder, source.files);
}

void Ingest(int argc, const char* const* argv) {
  Options options(
      "pipeline ingest",
      "Chooses and cleans the pictures of a folder, a quoted pattern or a video: decoded, upright, "
      "8-bit sRGB, one\nlongest side, without blurred, repeated and damaged ones. Writes "
      "ingest/images/*.png, ingest/masks/*.png\nand ingest/frames.json.");
  CommonOptions common;
  IngestFlags flags;
  fs::path input;
  options.AddPositional("INPUT", &input, "folder of photos, quoted pattern, or video", true);
  AddIngestOptions(&options, &flags);
  AddCommonOptions(&options, &common, false);
  if (!options.Parse(argc, argv)) return;
  IngestOptions ingest = ResolvedIngestOptions(flags);
  ingest.threads = ResolvedThreads(common);
  ingest.memory = ResolvedMemory(common);
  const PictureSource source = FindPictures(input);
  if (common.out.empty()) common.out = DefaultRunFolder(input);

  if (!flags.masks.empty()) ingest.masks = MasksOf(source, flags.masks);
  std::vector<fs::path> inputs = source.files;
  std::copy_if(
      ingest.masks.begin(), ingest.masks.end(), std::back_inserter(inputs), [](const fs::path& mask) {
        return !mask.empty();
      });
  StageRun stage("ingest", common, options, inputs);
  if (stage.IsUpToDate()) return;
  fs::create_directories(stage.folder() / "images");
  std::vector<std::string> hashes;
  for (const fs::path& file : source.files) hashes.push_back(stage.InputHash(file));
  const IngestReport report = source.is_video ? IngestVideo(source.files[0], ingest, stage.folder())
                                              : IngestPhotos(source, hashes, ingest, stage.folder());
  WriteFrames(stage.folder() / "frames.json", report.frames);
  for (const std::string& line : report.decisions) stage.Decide(line);
  stage.Set("input_kind", std::string(source.is_video ? "video" : "photos"));
  stage.Set("kept", static_cast<double>(report.frames.kept.size()));
  stage.Set("dropped", static_cast<double>(report.frames.dropped.size()));
  stage.Finish();
}

}  // namespace

int RunIngest(int argc, const char* const* argv) {
  return GuardedMain("pipeline ingest", [&] { Ingest(argc, argv); });
}

}  // namespace pipeline
