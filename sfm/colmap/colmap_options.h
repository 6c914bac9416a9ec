// COLMAP renamed its options in 3.13 (SiftExtraction.use_gpu became FeatureExtraction.use_gpu) and gives old
// names no alias. The installed program's own help text decides what it is called with, not its version.
#pragma once

#include <string>
#include <vector>

namespace sfm {

// Flags with their leading dashes.
struct ColmapFlags {
  std::string extraction_use_gpu, extraction_threads, extraction_image_size, extraction_features;
  std::string mapper_threads;
  // Flags and values that suit what surrounds the mapper here; without those that it does not list.
  std::vector<std::string> mapper_options;
  // Lets the mapper make points of matches between two pictures that no third one confirms.
  std::vector<std::string> two_view_tracks;
};

// From the output of `colmap feature_extractor -h` and `colmap mapper -h`. Throws io::Error kMissingTool
// naming the option that none of the known names stands for.
ColmapFlags ParseColmapHelp(const std::string& extractor_help, const std::string& mapper_help);

// The flag that lets COLMAP's matchers use a GPU, from the output of `colmap exhaustive_matcher -h`. Throws
// likewise.
std::string MatchingGpuFlag(const std::string& matcher_help);

}  // namespace sfm
