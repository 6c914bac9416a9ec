#include "io/video/video_writer.h"

#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "io/base/disk_room.h"
#include "io/base/error.h"
#include "io/base/memory.h"
#include "io/image/image.h"
#include "io/process/process.h"

namespace io {
namespace {

namespace fs = std::filesystem;

// Best first: what every browser plays, what newer ones play, what most desktop players play.
constexpr const char* kCodecs[] = {"libx264", "libvpx-vp9", "mpeg4"};
// An encoder slower than this per frame hangs.
constexpr double kStartTimeoutS = 60, kFrameTimeoutS = 5;
// Mean difference in grey levels between a frame and its decoded picture. Lossy coding stays below 5 even on
// noise; swapped channels or a wrong matrix exceed it.
constexpr double kMaxMeanDifference = 16;

std::vector<std::string> CodecArguments(const std::string& codec) {
  if (codec == "libx264") return {"-c:v", "libx264", "-preset", "medium", "-crf", "18"};
  if (codec == "libvpx-vp9") return {"-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1"};
  return {"-c:v", codec, "-q:v", "3"};
}

double MeanDifference(const cv::Mat& bgr, const Image& image) {
  double sum = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const cv::Vec3b& p = bgr.at<cv::Vec3b>(y, x);
      for (int c = 0; c < 3; ++c) sum += std::abs(p[2 - c] - image.Pixel(x, y)[c]);
    }
  }
  return sum / static_cast<double>(image.data.size());
}

// Empty when `mp4` decodes to the frames of `folder`, else what is wrong with it.
std::string FaultOfVideo(const fs::path& mp4, const fs::path& folder, int frames) {
  const Image first = ReadImage(folder / VideoFrameName(0));
  cv::VideoCapture capture;
  errno = 0;
  if (!capture.open(mp4.string(), cv::CAP_FFMPEG)) {
    ThrowIfMemoryWasRefused();
    return "the product cannot be opened";
  }
  int decoded = 0;
  for (cv::Mat bgr; capture.read(bgr); ++decoded) {
    if (bgr.cols != first.width || bgr.rows != first.height || bgr.type() != CV_8UC3) {
      return "the product has another size than the frames";
    }
    if (decoded == 0 && MeanDifference(bgr, first) > kMaxMeanDifference) {
      return "the product does not look like the frames";
    }
  }
  if (decoded == frames) return "";
  ThrowIfMemoryWasRefused();
  return fmt::format("the product has {} frames instead of {}", decoded, frames);
}

}  // namespace

std::size_t EncodingBytes(int width, int height) {
  constexpr std::size_t kProgram = std::size_t{80} << 20, kPerPixel = 230;
  return kProgram + kPerPixel * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

std::string VideoFrameName(int index) { return fmt::format("{:06}.png", index + 1); }

VideoReport EncodeVideo(
    const VideoEncoder& encoder, const fs::path& folder, int frames, double fps, const fs::path& mp4) {
  const fs::path target = fs::absolute(mp4), partial = target.string() + ".partial.mp4";
  const fs::path log = target.string() + ".log";
  fs::remove(log);
  const std::string rate = fmt::format("{:.6g}", fps);
  // The pattern is relative to the working folder, because image2 would read a % in the folder's name as part
  // of it; "file:" keeps a colon in the path from being read as a protocol.
  std::vector<std::string> argv = {encoder.ffmpeg.string(), "-nostdin", "-hide_banner", "-loglevel", "error"};
  argv.insert(argv.end(), {"-y", "-f", "image2", "-framerate", rate, "-start_number", "1", "-i", "%06d.png"});
  argv.insert(argv.end(), {"-frames:v", std::to_string(frames)});
  // The BT.601 matrix, and a tag that says so: browsers read the tag, and readers that ignore it assume this
  // matrix for pictures of a film's size.
  argv.insert(argv.end(), {"-vf", "scale=out_color_matrix=bt601:out_range=tv,format=yuv420p"});
  for (const std::string& argument : CodecArguments(encoder.codec)) argv.push_back(argument);
  argv.insert(argv.end(), {"-pix_fmt", "yuv420p", "-color_range", "tv", "-colorspace", "smpte170m"});
  argv.insert(argv.end(), {"-color_primaries", "bt709", "-color_trc", "iec61966-2-1"});
  argv.insert(argv.end(), {"-movflags", "+faststart", "file:" + partial.string()});

  ProcessOptions options;
  options.timeout_s = kStartTimeoutS + kFrameTimeoutS * frames;
  options.log_path = log;
  options.working_dir = folder;
  const ProcessReport process = RunProcess(argv, options);
  std::string fault;
  if (process.timed_out) {
    fault = fmt::format("stopped after {} s", static_cast<int>(options.timeout_s));
  } else if (!process.Ok()) {
    fault = process.signal != 0 ? fmt::format("signal {}", process.signal)
                                : fmt::format("exit code {}", process.exit_code);
  } else {
    fault = FaultOfVideo(partial, folder, frames);
  }
  if (!fault.empty()) {
    try {
      ThrowIfFull(target.parent_path());
    } catch (...) {
      fs::remove(partial);
      fs::remove(log);
      throw;
    }
    std::string last_words = LogTail(log, 2);
    for (char& c : last_words) c = c == '\n' ? ' ' : c;
    fs::remove(partial);
    fs::remove(log);
    throw Error(ExitCode::kMissingTool,
                "ffmpeg could not encode " + mp4.string() + " with " + encoder.codec + " (" + fault +
                    "): " + last_words,
                "The frames are kept in " + folder.string());
  }
  fs::rename(partial, target);
  fs::remove(log);
  return {frames, fs::file_size(target), process.cpu_s, process.peak_rss_bytes};
}

VideoEncoder ProbeVideoEncoder(int width, int height, const fs::path& scratch) {
  const auto ffmpeg = FindProgram("ffmpeg");
  if (!ffmpeg) {
    throw Error(
        ExitCode::kMissingTool, "the program ffmpeg is not on PATH", "Install it: apt-get install ffmpeg");
  }
  const fs::path clip = fs::absolute(scratch) / "encoder_probe";
  fs::create_directories(clip);
  for (int i = 0; i < 2; ++i) {
    Image frame = MakeImage(width, height, 3);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        frame.Pixel(x, y)[0] = static_cast<std::uint8_t>(255 * x / width);
        frame.Pixel(x, y)[1] = static_cast<std::uint8_t>(255 * y / height);
        frame.Pixel(x, y)[2] = static_cast<std::uint8_t>(60 + 20 * i);
      }
    }
    WriteImage(clip / VideoFrameName(i), frame);
  }
  VideoEncoder encoder{*ffmpeg, "", ""};
  std::string failures;
  for (const char* codec : kCodecs) {
    encoder.codec = codec;
    try {
      EncodeVideo(encoder, clip, 2, 30, clip / "probe.mp4");
      fs::remove_all(clip);
      encoder.decision = std::string("film codec ") + codec + ": a two-frame clip decodes again";
      if (!failures.empty()) encoder.decision += "; not better ones because " + failures;
      return encoder;
    } catch (const Error& error) {
      if (error.code() == ExitCode::kNoResources) throw;
      failures += (failures.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  fs::remove_all(clip);
  throw Error(
      ExitCode::kMissingTool,
      fmt::format("{}: no codec can write an MP4 of {}x{} ({})", ffmpeg->string(), width, height, failures),
      "Install a complete ffmpeg: apt-get install ffmpeg");
}

}  // namespace io
