#include "pipeline/ingest/ingest_options.h"

#include <charconv>

#include "io/base/error.h"

namespace pipeline {
namespace {

struct FrameRange {
  int first = IngestOptions().first_frame, last = IngestOptions().last_frame;
};

// "A:B", both included; either may be missing.
FrameRange ParseFrameRange(const std::string& option_name, const std::string& text) {
  FrameRange range;
  const std::size_t colon = text.find(':');
  const auto parse = [&](const std::string& part, int* value) {
    if (part.empty()) return true;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), *value);
    return error == std::errc() && end == part.data() + part.size() && *value >= 0;
  };
  const bool ok = colon != std::string::npos && parse(text.substr(0, colon), &range.first) &&
                  parse(text.substr(colon + 1), &range.last);
  if (!ok || (range.last >= 0 && range.last < range.first)) {
    throw io::Error(io::ExitCode::kUsage,
                    "--" + option_name + ": '" + text + "' is not a range of frames",
                    "Write for example 0:420");
  }
  return range;
}

}  // namespace

void AddIngestOptions(Options* options, IngestFlags* flags) {
  options->Add(
      "masks",
      &flags->masks,
      "folder of masks, IMG_1.png for IMG_1.jpg: white is used, black is not; a photo without one is "
      "used whole",
      {.affects_result = false});  // the files decide, not their folder's name
  options->Add("max-size",
               &flags->ingest.max_side,
               "longest side of the kept pictures in pixels",
               {.min = 64});  // below, no feature is found
  options->Add(
      "max-frames", &flags->ingest.selection.max_frames, "most frames to keep of a video", {.min = 3});
  options->Add("frames",
               &flags->frames,
               "part of a video to use, A:B, first and last frame number",
               {.check = ParseFrameRange});
  options->Add("blur",
               &flags->ingest.selection.min_relative_sharpness,
               "drop pictures below this share of their neighbours' sharpness; 0 keeps all",
               {.min = 0, .below = 1});
  options->Add("find-overlay",
               &flags->ingest.find_overlay,
               "cut off black bars, and mask out what lies over every picture: a date, a logo, a bonnet");
  options->Add("find-fisheye",
               &flags->ingest.find_fisheye,
               "straighten the pictures of a fisheye lens or an action camera");
}

IngestOptions ResolvedIngestOptions(const IngestFlags& flags) {
  IngestOptions options = flags.ingest;
  if (!flags.frames.empty()) {
    const FrameRange range = ParseFrameRange("frames", flags.frames);
    options.first_frame = range.first;
    options.last_frame = range.last;
  }
  return options;
}

}  // namespace pipeline
