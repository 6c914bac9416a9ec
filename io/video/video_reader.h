// Frames of a video file, in order, upright, with the times the container gives them.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "io/image/image.h"

namespace io {

struct VideoInfo {
  int width = 0, height = 0;       // before rotation
  int container_frames = 0;        // what the container promises; exact for MP4, an estimate for others
  std::vector<std::string> notes;  // what a user should know about the conversion
};

struct VideoFrame {
  Image image;        // RGB, rotation metadata applied
  int index = 0;      // decoded frames before this one
  double time_s = 0;  // presentation time
};

class VideoReader {
 public:
  // Opens MP4/MOV, Matroska/WebM or AVI, told by content: playlists and lists of other files are refused, and
  // the demuxer may open this file only. Throws kBadInput naming the file.
  explicit VideoReader(const std::filesystem::path& path);
  ~VideoReader();

  const VideoInfo& info() const;

  // The next frame in sRGB (io/video/video_colours.h), its longest side limited to max_side [px] by area
  // averaging. False at the end.
  bool Read(int max_side, VideoFrame* frame);
  // The same with the colours that the decoder makes of it, for measurements.
  bool ReadAsDecoded(int max_side, VideoFrame* frame);
  // Passes over the next frame. False at the end.
  bool Skip();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace io
