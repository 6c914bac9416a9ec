#include "io/video/video_reader.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <optional>

#include "io/base/error.h"
#include "io/base/memory.h"
#include "io/image/media_type.h"
#include "io/image/photo.h"
#include "io/video/mp4_boxes.h"
#include "io/video/video_tags.h"

namespace io {
namespace {

[[noreturn]] void Refuse(const std::filesystem::path& path,
                         const std::string& what,
                         const std::string& remedy) {
  throw Error(ExitCode::kBadInput, path.string() + ": " + what, remedy);
}

std::string ReadAt(int fd, off_t offset, std::size_t size) {
  std::string bytes(size, '\0');
  const ssize_t n = pread(fd, bytes.data(), size, offset);
  bytes.resize(n < 0 ? 0 : static_cast<std::size_t>(n));
  return bytes;
}

}  // namespace

struct VideoReader::State {
  int fd = -1;
  cv::VideoCapture capture;
  VideoInfo info;
  VideoTags tags;
  std::optional<ColourConversion> colours;
  int n_read = 0;
  int orientation = 1;

  ~State() {
    capture.release();
    if (fd >= 0) close(fd);
  }
};

VideoReader::VideoReader(const std::filesystem::path& path) : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (s.fd < 0) Refuse(path, "cannot be read", "Check the name and its permissions");
  const MediaType type = MediaTypeOf(ReadAt(s.fd, 0, kMediaTypeBytes));
  if (!IsVideo(type)) {
    Refuse(path,
           "its content is not a video",
           std::string("Give ") + kAcceptedVideos + " or a folder of photos");
  }
  if (type == MediaType::kMp4) {
    const Mp4Header header = ReadMp4Header(s.fd);
    if (!header.has_index) {
      Refuse(path,
             "incomplete recording: it has no index (moov)",
             "Copy it again, or repair it with the camera");
    }
    s.orientation = header.orientation;
  }
  // The demuxers whose magic bytes were seen, and no protocol but files. FFmpeg's own messages would only
  // repeat what the frame counts say.
  setenv("OPENCV_FFMPEG_CAPTURE_OPTIONS", "protocol_whitelist;file|format_whitelist;mov,matroska,avi", 1);
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 1);
  // The descriptor's name hides the file's own name, in which FFmpeg would see protocols and number patterns.
  bool opened = false;
  errno = 0;
  try {
    opened = s.capture.open(fmt::format("/proc/self/fd/{}", s.fd), cv::CAP_FFMPEG);
  } catch (const cv::Exception&) {
  }
  if (!opened) {
    ThrowIfMemoryWasRefused();
    Refuse(
        path, "no video stream in it that can be decoded", "Check that it plays; convert it to H.264 in MP4");
  }
  // OpenCV turns to the wrong side in 4.6 and not at all in 4.11, so this is done here.
  s.capture.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
  s.info.width = static_cast<int>(s.capture.get(cv::CAP_PROP_FRAME_WIDTH));
  s.info.height = static_cast<int>(s.capture.get(cv::CAP_PROP_FRAME_HEIGHT));
  s.info.container_frames = static_cast<int>(std::clamp(s.capture.get(cv::CAP_PROP_FRAME_COUNT), 0.0, 1e9));
  // FFmpeg's tag of planar YUV with more than 8 bits: 'Y', plane layout, 11 or 10, bits.
  const auto pixel_format = static_cast<std::uint32_t>(s.capture.get(cv::CAP_PROP_CODEC_PIXEL_FORMAT));
  const std::uint32_t bits = pixel_format >> 24;
  if ((pixel_format & 0xff) == 'Y' && bits > 8 && bits <= 16)
    s.info.notes.push_back(fmt::format("{} bits per channel reduced to 8", bits));
  s.tags = ReadVideoTags(path);
  s.colours.emplace(s.tags.colours, std::min(s.info.width, s.info.height));
  if (s.colours->IsHdr())
    s.info.notes.push_back("high dynamic range brought to that of photos, colours to sRGB");
  if (s.tags.is_interlaced)
    s.info.notes.push_back("interlaced: of each frame the rows of one field, so that none shows two moments");
  if (s.tags.pixel_aspect != 1)
    s.info.notes.push_back(
        fmt::format("pixels {:.3g} times as wide as high made square", s.tags.pixel_aspect));
}

VideoReader::~VideoReader() = default;

const VideoInfo& VideoReader::info() const { return state_->info; }

bool VideoReader::Skip() {
  if (!state_->capture.grab()) return false;
  ++state_->n_read;
  return true;
}

bool VideoReader::Read(int max_side, VideoFrame* frame) {
  if (!ReadAsDecoded(max_side, frame)) return false;
  state_->colours->Convert(&frame->image);
  return true;
}

bool VideoReader::ReadAsDecoded(int max_side, VideoFrame* frame) {
  if (!Skip()) return false;
  State& s = *state_;
  cv::Mat bgr;
  if (!s.capture.retrieve(bgr) || bgr.type() != CV_8UC3) return false;
  frame->index = s.n_read - 1;
  frame->time_s = s.capture.get(cv::CAP_PROP_POS_MSEC) / 1000.0;
  int width = cvRound(bgr.cols * s.tags.pixel_aspect), height = bgr.rows;
  FitWithin(max_side, &width, &height);
  // Every other row, which is one field.
  if (s.tags.is_interlaced && bgr.rows > 1)
    bgr = cv::Mat(bgr.rows / 2, bgr.cols, bgr.type(), bgr.data, 2 * bgr.step).clone();
  cv::Mat small = bgr;
  if (bgr.size() != cv::Size(width, height)) {
    const bool shrinks = width <= bgr.cols && height <= bgr.rows;
    cv::resize(bgr, small, {width, height}, 0, 0, shrinks ? cv::INTER_AREA : cv::INTER_CUBIC);
  }
  frame->image = MakeImage(width, height, 3);
  cv::Mat target(height, width, CV_8UC3, frame->image.data.data());
  cv::cvtColor(small, target, cv::COLOR_BGR2RGB);
  if (s.orientation != 1) frame->image = ApplyOrientation(frame->image, s.orientation);
  return true;
}

}  // namespace io
