// The little that must be known of an MP4 or QuickTime file before a decoder opens it (ISO/IEC 14496-12).
#pragma once

namespace io {

struct Mp4Header {
  bool has_index = false;  // 'moov' is there; a recording that was cut off lacks it
  int orientation = 1;     // of the video track, as the EXIF value with the same meaning: 1, 3, 6 or 8
};

// Walks box headers by position; reads no payload but two fields and never allocates by a size in the file.
Mp4Header ReadMp4Header(int fd);

}  // namespace io
