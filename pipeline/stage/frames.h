// frames.json: which pictures `pipeline ingest` kept, which it dropped, and why.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pipeline {

struct KeptPicture {
  std::string name;    // file name in images/, and of its mask in masks/: letters, digits, '.', '_', '-'
  std::string source;  // printable name of the user's file, or "frame 17"
  int width = 0, height = 0;
  double sharpness = 0;            // io::Sharpness
  std::optional<double> focal_px;  // from EXIF, for width x height
  bool has_mask = false;
  bool is_panorama = false;      // during ingest: its views will replace it (pipeline/ingest/panorama.h)
  std::string panorama;          // whose view it is; empty: of none
  double heading_deg = 0;        // of such a view, to the right of the panorama's middle
  int camera_group = 0;          // pictures with equal numbers come from one camera and setting
  std::optional<double> time_s;  // in the video
  std::vector<std::string> notes;
};

struct DroppedPicture {
  std::string source;  // as KeptPicture::source
  std::string reason;
};

struct Frames {
  std::vector<KeptPicture> kept;  // in natural order, no name twice
  std::vector<DroppedPicture> dropped;
};

void WriteFrames(const std::filesystem::path& path, const Frames& frames);

// Throws kBadInput naming the file and the place when it is absent or is not what WriteFrames writes.
Frames ReadFrames(const std::filesystem::path& path);

}  // namespace pipeline
