// A photograph on disk as a camera would leave it: JPEG with EXIF.
#pragma once

#include <filesystem>

#include "io/image/image.h"

namespace samples {

struct CameraTags {
  double focal_35mm =
      0;  // focal length of equal diagonal field of view on 36 x 24 mm film [mm]; rounded as EXIF does
  double exposure_s = 0.01;  // [s]
  int taken_after_s = 0;     // since the first photograph of the series [s], below one day
};

// Writes the file atomically. quality: JPEG's 1 ... 100, colour at half resolution. Throws kNoResources.
void WritePhoto(const std::filesystem::path& path,
                const io::Image& image,
                int quality,
                const CameraTags& tags);

}  // namespace samples
