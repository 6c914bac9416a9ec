// What a video's header says about its frames.
#pragma once

#include <filesystem>

#include "io/video/video_colours.h"

namespace io {

struct VideoTags {
  VideoColours colours;
  bool is_interlaced = false;  // odd and even rows of a frame are from different moments
  double pixel_aspect = 1;     // width of a pixel over its height
};

// As ffprobe reads them; nothing where it is missing or does not answer.
VideoTags ReadVideoTags(const std::filesystem::path& path);

}  // namespace io
