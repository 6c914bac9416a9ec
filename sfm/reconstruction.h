// Pictures in, cameras and sparse points out: chooses the pairs to match, runs COLMAP, reads all of its
// models, judges the largest, and tries once more with a stronger setting before it gives up.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "io/colmap_model.h"

namespace sfm {

struct Picture {
  std::string name;  // file inside the pictures' folder: letters, digits, '.', '_' and '-'
  int width = 0, height = 0;
  double focal_px = 0;       // from EXIF; 0: unknown
  std::string camera_group;  // pictures with the same text share one camera
  bool is_video_frame = false;
};

struct ReconstructionOptions {
  int features = 2048;                         // per picture
  std::string camera_model = "SIMPLE_RADIAL";  // COLMAP's name
  std::string matching = "auto";               // auto, exhaustive, likely or sequential
  double retry_minutes = 20;  // ceiling for matching in the second attempt; 0: no second attempt
  int threads = 1;
};

struct Unregistered {
  std::string name, cause;
};

struct Reconstruction {
  io::ColmapModel model;                               // image paths are the pictures' names
  std::filesystem::path sparse_folder, database, log;  // of the attempt that was used, below the work folder
  std::vector<Unregistered> unregistered;
  double triangulation_angle_deg = 0;  // median over the points
  double cpu_s = 0;                    // of COLMAP, all attempts
  std::size_t peak_rss_bytes = 0;
};

// decide: receives one line for every choice. Throws io::Error kNotReconstructible with one named cause
// (sfm/diagnosis.h), kMissingTool when COLMAP is missing or fails, kNoResources when it runs out of memory,
// kUsage for an unknown camera model or way of matching. The result may differ in the last digits between
// runs: COLMAP's mapper is not deterministic on several threads.
Reconstruction Reconstruct(const std::vector<Picture>& pictures,
                           const std::filesystem::path& images_folder,
                           const std::filesystem::path& work_folder,
                           const ReconstructionOptions& options,
                           const std::function<void(const std::string&)>& decide);

}  // namespace sfm
