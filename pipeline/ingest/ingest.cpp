#include "pipeline/ingest/ingest.h"

#include <algorithm>
#include <charconv>
#include <iterator>

#include "io/base/error.h"
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

// "A:B", both included; either may be missing.
void ParseFrameRange(const std::string& text, IngestOptions* options) {
  if (text.empty()) return;
  const std::size_t colon = text.find(':');
  const auto parse = [&](const std::string& part, int* value) {
    if (part.empty()) return true;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), *value);
    return error == std::errc() && end == part.data() + part.size() && *value >= 0;
  };
  const bool ok = colon != std::string::npos && parse(text.substr(0, colon), &options->first_frame) &&
                  parse(text.substr(colon + 1), &options->last_frame);
  if (!ok || (options->last_frame >= 0 && options->last_frame < options->first_frame)) {
    throw Error(
        ExitCode::kUsage, "--frames: '" + text + "' is not a range of frames", "Write for example 0:420");
  }
}

void CheckRanges(const IngestOptions& options) {
  constexpr int kMinSide = 64;  // below, no feature is found
  if (options.max_side < kMinSide) throw Error(ExitCode::kUsage, "--max-size: at least 64 pixels");
  if (options.selection.max_frames < 3) throw Error(ExitCode::kUsage, "--max-frames: at least 3");
  const double blur = options.selection.min_relative_sharpness;
  if (!(blur >= 0 && blur < 1)) throw Error(ExitCode::kUsage, "--blur: from 0 to below 1");
}

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
  IngestOptions ingest;
  fs::path input, masks;
  std::string frames;
  options.AddPositional("INPUT", &input, "folder of photos, quoted pattern, or video", true);
  options.Add("masks",
              &masks,
              "folder of masks, IMG_1.png for IMG_1.jpg: white is used, black is not; a photo without one is "
              "used whole",
              false);  // the files decide, not their folder's name
  options.Add("max-size", &ingest.max_side, "longest side of the kept pictures in pixels");
  options.Add("max-frames", &ingest.selection.max_frames, "most frames to keep of a video");
  options.Add("frames", &frames, "part of a video to use, A:B, first and last frame number");
  options.Add("blur",
              &ingest.selection.min_relative_sharpness,
              "drop pictures below this share of their neighbours' sharpness; 0 keeps all");
  AddCommonOptions(&options, &common);
  if (!options.Parse(argc, argv)) return;
  ParseFrameRange(frames, &ingest);
  CheckRanges(ingest);
  ingest.threads = ResolvedThreads(common);
  const PictureSource source = FindPictures(input);
  if (common.out.empty()) common.out = DefaultRunFolder(input);

  if (!masks.empty()) ingest.masks = MasksOf(source, masks);
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
