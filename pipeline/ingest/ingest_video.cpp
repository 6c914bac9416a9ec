// The video half of the ingest stage: one pass over small frames to choose, one over the chosen at full size.
#include <fmt/format.h>

#include <algorithm>

#include "io/base/error.h"
#include "io/image/image.h"
#include "io/image/picture_measure.h"
#include "io/process/interrupt.h"
#include "io/process/progress.h"
#include "io/video/camera_motion.h"
#include "io/video/video_reader.h"
#include "pipeline/ingest/ingest.h"
#include "pipeline/ingest/lens_straightening.h"
#include "pipeline/ingest/overlay.h"
#include "pipeline/ingest/overlay_removal.h"
#include "pipeline/ingest/panorama.h"

namespace pipeline {
namespace {

using io::Error;
using io::ExitCode;
namespace fs = std::filesystem;

constexpr int kMeasureSide = 640;  // [px] what io::Sharpness looks at
constexpr int kBarFrames = 40;     // among which bars are sought, twice as many at most
constexpr int kBarSide = 320;      // [px] of these frames
constexpr double kDark = 8;        // [grey levels] a frame whose mean is below has no light
constexpr double kMinPath = 0.02;  // [picture widths] a shorter path is a tremor of the hand
constexpr double kCompleteShare =
    0.98;  // of the frames that the container promises, which may be an estimate
// Of a frame, for the decoder's reference frames, those of its threads, and conversions.
constexpr std::size_t kBytesPerPixel = 60;
constexpr double kPanoramaShare = 0.8;  // of the frames; single ones may be black, or a title
// Views of a panorama overlap: a third as many panoramas make twice as many pictures.
constexpr int kFramesPerPanorama = 3;
constexpr std::size_t kMinFrames = 3;  // two views fix no scene and leave none to check with

struct VideoMeasure {
  std::vector<double> path, sharpness, time_s;  // per frame from options.first_frame on
  double brightest = 0;                         // mean grey level of the brightest frame
  int n_decoded = 0;                            // frames before and in the range
  bool reached_end = false;
  bool shows_panoramas = false;
};

io::Image SmallFrame(const io::Image& frame) {
  const double scale = std::min(1.0, static_cast<double>(kBarSide) / std::max(frame.width, frame.height));
  return io::ResizeArea(frame,
                        std::max(1, static_cast<int>(frame.width * scale)),
                        std::max(1, static_cast<int>(frame.height * scale)));
}

// Of a frame's width, what is not bars.
double ContentShare(const std::vector<io::Image>& frames, int threads) {
  const Bars bars = FindOverlay(frames, threads).bars;
  return frames.empty() ? 1 : 1 - static_cast<double>(bars.left + bars.right) / frames[0].width;
}

VideoMeasure Measure(io::VideoReader* reader, const IngestOptions& options) {
  VideoMeasure measure;
  io::CameraMotion motion;
  io::VideoFrame frame;
  const int last = options.last_frame < 0 ? reader->info().container_frames : options.last_frame + 1;
  const int n_expected = std::max(1, last - options.first_frame), every = (n_expected - 1) / kBarFrames + 1;
  std::vector<io::Image> sampled;
  io::Progress progress("measuring frames");
  while (options.last_frame < 0 || measure.n_decoded <= options.last_frame) {
    io::ThrowIfInterrupted();
    const bool in_range = measure.n_decoded >= options.first_frame;
    if (!(in_range ? reader->ReadAsDecoded(kMeasureSide, &frame) : reader->Skip())) {
      measure.reached_end = true;
      break;
    }
    ++measure.n_decoded;
    progress.Update(std::min(0.999, measure.n_decoded / std::max(1.0, static_cast<double>(last))),
                    "frame " + std::to_string(measure.n_decoded));
    if (!in_range) continue;
    const bool is_sampled = static_cast<int>(measure.path.size()) % every == 0;
    if (is_sampled && sampled.size() < 2 * kBarFrames) sampled.push_back(SmallFrame(frame.image));
    measure.path.push_back(motion.Advance(frame.image));
    measure.sharpness.push_back(io::Sharpness(frame.image));
    measure.time_s.push_back(frame.time_s);
    measure.brightest = std::max(measure.brightest, io::Brightness(io::MakeThumbnail(frame.image)));
  }
  const auto n_panoramas = std::count_if(sampled.begin(), sampled.end(), IsPanorama);
  measure.shows_panoramas =
      static_cast<double>(n_panoramas) > kPanoramaShare * static_cast<double>(sampled.size());
  // Frames are chosen by how far the picture moves, in widths of what it shows.
  if (options.find_overlay) {
    const double share = ContentShare(sampled, options.threads);
    for (double& width : measure.path) width /= share;
  }
  return measure;
}

void RefuseUnusable(const VideoMeasure& measure, const IngestOptions& options, const std::string& name) {
  if (measure.path.empty()) {
    throw Error(ExitCode::kBadInput,
                fmt::format("{}: {} frames can be decoded, none from frame {} on",
                            name,
                            measure.n_decoded,
                            options.first_frame),
                "Check that the video plays, and --frames");
  }
  if (measure.brightest < kDark) {
    throw Error(
        ExitCode::kNotReconstructible, name + ": no light, all frames are black", "Film with more light");
  }
  if (measure.path.back() < kMinPath) {
    throw Error(ExitCode::kNotReconstructible,
                name + ": no motion, all frames show the same",
                "Walk around the object while filming");
  }
}

// Decodes again and writes the frames whose verdict is "kept".
void WriteKeptFrames(const fs::path& video,
                     const IngestOptions& options,
                     const std::vector<FrameVerdict>& verdicts,
                     const VideoMeasure& measure,
                     const fs::path& folder,
                     Frames* frames,
                     OverlayRemoval* overlay) {
  const int max_side = measure.shows_panoramas ? PanoramaWidth(options.max_side) : options.max_side;
  io::VideoReader reader(video);
  io::VideoFrame frame;
  io::Progress progress("writing frames");
  const int n_frames = options.first_frame + static_cast<int>(verdicts.size());
  for (int index = 0; index < n_frames; ++index) {
    io::ThrowIfInterrupted();
    progress.Update((index + 1.0) / n_frames);
    const auto i = static_cast<std::size_t>(std::max(0, index - options.first_frame));
    const bool kept = index >= options.first_frame && verdicts[i].kept;
    if (!(kept ? reader.Read(max_side, &frame) : reader.Skip())) {
      throw Error(
          ExitCode::kBadInput,
          fmt::format(
              "{}: frame {} could be decoded before and cannot now", PrintableName(video.string()), index),
          "Run again when the file no longer changes");
    }
    const std::string source = "frame " + std::to_string(index);
    if (index >= options.first_frame && !kept) frames->dropped.push_back({source, verdicts[i].reason});
    if (!kept) continue;
    const std::string name = fmt::format("frame_{:06}.png", index);
    io::WriteImage(folder / "images" / name, frame.image);
    overlay->Look(frames->kept.size(), name, frame.image);
    KeptPicture picture;
    picture.name = name;
    picture.source = source;
    picture.width = frame.image.width;
    picture.height = frame.image.height;
    picture.is_panorama = measure.shows_panoramas;
    picture.sharpness = measure.sharpness[i];
    picture.time_s = measure.time_s[i];
    frames->kept.push_back(picture);
  }
}

}  // namespace

IngestReport IngestVideo(const fs::path& video, const IngestOptions& options, const fs::path& folder) {
  std::string name = PrintableName(video.string());
  io::VideoReader reader(video);
  options.memory.Require(
      kBytesPerPixel * static_cast<std::size_t>(reader.info().width) *
              static_cast<std::size_t>(std::max(0, reader.info().height)) +
          OverlayRemoval::Bytes(static_cast<std::size_t>(options.selection.max_frames), options.max_side),
      fmt::format("ingest: {} of {} x {} pixels", name, reader.info().width, reader.info().height));
  const VideoMeasure measure = Measure(&reader, options);

  IngestReport report;
  report.decisions = reader.info().notes;
  const int promised = reader.info().container_frames;
  if (measure.reached_end && measure.n_decoded < kCompleteShare * promised) {
    const std::string incomplete =
        fmt::format("incomplete file: {} of {} frames could be decoded", measure.n_decoded, promised);
    report.decisions.push_back(incomplete);
    name += " (" + incomplete + ")";
  }
  RefuseUnusable(measure, options, name);
  SelectionOptions selection = options.selection;
  if (measure.shows_panoramas)
    selection.max_frames = std::max(static_cast<int>(kMinFrames), selection.max_frames / kFramesPerPanorama);
  const std::vector<FrameVerdict> verdicts =
      JudgeFrames(measure.path, measure.sharpness, options.first_frame, selection);
  OverlayRemoval overlay(static_cast<std::size_t>(std::count_if(
      verdicts.begin(), verdicts.end(), [](const FrameVerdict& verdict) { return verdict.kept; })));
  WriteKeptFrames(video, options, verdicts, measure, folder, &report.frames, &overlay);
  const std::size_t n_kept = report.frames.kept.size();  // each panorama will be several pictures
  if (options.find_overlay) overlay.Apply(folder, options.threads, &report);
  if (options.find_fisheye) StraightenLenses(folder, options, &report);
  UnrollPanoramas(folder, options, &report);
  report.decisions.push_back(
      fmt::format("{} of {} frames kept: the picture moved by {:.1f} of its widths, and the sharpest frame "
                  "of each equal step "
                  "stays",
                  n_kept,
                  verdicts.size(),
                  measure.path.back()));
  for (const DroppedPicture& picture : report.frames.dropped) {
    if (picture.reason.rfind("blurred", 0) == 0) {
      report.decisions.push_back("dropped " + picture.source + ": " + picture.reason);
    }
  }
  if (n_kept < kMinFrames) {
    throw Error(ExitCode::kNotReconstructible,
                fmt::format("{}: almost no motion, {} different views in it", name, n_kept),
                "Walk around the object while filming");
  }
  return report;
}

}  // namespace pipeline
