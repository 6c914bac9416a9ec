// A picture whose camera is to be found.
#pragma once

#include <string>

namespace sfm {

struct Picture {
  std::string name;  // file inside the pictures' folder: letters, digits, '.', '_' and '-'
  int width = 0, height = 0;
  double focal_px = 0;       // from EXIF; 0: unknown
  std::string camera_group;  // pictures with the same text share one camera
  bool is_video_frame = false;
};

}  // namespace sfm
