// Numbered PNG frames in, an MP4 out, through the ffmpeg program. The frames stay on disk, so an encoder's
// failure costs nothing but the film.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace io {

struct VideoEncoder {
  std::filesystem::path ffmpeg;
  std::string codec;     // ffmpeg's name: "libx264", or a fallback
  std::string decision;  // which codec was chosen, and why no better one
};

struct VideoReport {
  int frames = 0;
  std::size_t bytes = 0;
  double cpu_s = 0;  // of the external program
  std::size_t peak_rss_bytes = 0;
};

// Encodes a clip of two frames with each codec, best first, until one's product decodes again: H.264, VP9,
// MPEG-4. `scratch` is a folder to work in; nothing stays there. Throws kMissingTool when there is no ffmpeg
// or none of its codecs works.
VideoEncoder ProbeVideoEncoder(int width, int height, const std::filesystem::path& scratch);

// The name of frame i = 0, 1, ...: "000001.png", "000002.png", ...
std::string VideoFrameName(int index);

// Bytes that ffmpeg takes for a film of this size, most of them for the frames that x264 looks ahead:
// measured on two cores.
std::size_t EncodingBytes(int width, int height);

// Encodes frames 0 .. frames - 1 of `folder` (even width and height) as yuv420p, index in front
// so that browsers start at once. The product is decoded and compared with the frames before it gets its
// name. Throws kMissingTool with the encoder's last words.
VideoReport EncodeVideo(const VideoEncoder& encoder,
                        const std::filesystem::path& folder,
                        int frames,
                        double fps,
                        const std::filesystem::path& mp4);

}  // namespace io
