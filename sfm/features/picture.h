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
  // Views of one panorama have the same text here, and look so far to the right of its middle. Empty: a
  // picture by itself.
  std::string rig;
  double heading_deg = 0;
};

}  // namespace sfm
