// Runs the installed COLMAP step by step. Each step gets an argument vector, a wall-clock and an
// address-space limit, and its product is verified: COLMAP exits 0 after skipping unreadable pictures or on a
// full disk.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "sfm/colmap_options.h"
#include "sfm/image_pairs.h"

namespace sfm {

// Pictures that share one camera: same size, same lens setting.
struct CameraGroup {
  std::vector<std::string> names;
  int width = 0, height = 0;
  double focal_px = 0;  // 0: unknown, COLMAP guesses and refines
};

struct ExtractionOptions {
  int max_features = 2048;                     // per picture
  std::string camera_model = "SIMPLE_RADIAL";  // or SIMPLE_PINHOLE, PINHOLE, RADIAL, OPENCV
};

class Colmap {
 public:
  // work_folder: empty and private; receives database.db, sparse/ and colmap.log. Throws io::Error
  // kMissingTool when COLMAP is not on PATH or lacks an option.
  Colmap(std::filesystem::path images_folder, std::filesystem::path work_folder, int threads);

  // Detects SIFT features on the CPU. Throws kMissingTool when a picture did not reach the database.
  void ExtractFeatures(const std::vector<CameraGroup>& groups, const ExtractionOptions& options);

  // Matches and verifies the pairs of `names`. Returns false when `max_seconds` ran out (0: no such ceiling;
  // a limit against hanging always holds).
  bool MatchPairs(const std::vector<std::string>& names, const ImagePairs& pairs, double max_seconds = 0);

  // Incremental mapping; the folders of all sub-models, none when COLMAP found no initial pair.
  std::vector<std::filesystem::path> Map(int n_pictures);

  const std::filesystem::path& database() const { return database_; }
  double cpu_s() const { return cpu_s_; }
  std::size_t peak_rss_bytes() const { return peak_rss_bytes_; }

 private:
  struct Step;
  bool Run(const Step& step);

  std::filesystem::path program_, images_folder_, work_folder_, database_, log_path_;
  int threads_;
  std::size_t memory_bytes_;
  ColmapFlags flags_;
  double cpu_s_ = 0;
  std::size_t peak_rss_bytes_ = 0;
};

}  // namespace sfm
