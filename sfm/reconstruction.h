// Pictures in, cameras and sparse points out: detects, matches and verifies features, lets COLMAP map them,
// reads all of its models, judges the largest, tries again with stronger settings when too few pictures
// register, and adjusts the model that is kept.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "io/process/shared_work.h"
#include "io/scene/colmap_model.h"
#include "sfm/bundle/bundle_uncertainty.h"
#include "sfm/features/features.h"
#include "sfm/features/matching.h"
#include "sfm/features/picture.h"
#include "sfm/mapping/capture_blocks.h"
#include "sfm/mapping/refusal.h"

namespace sfm {

struct ReconstructionOptions {
  std::string detector = "opencv";  // or colmap
  int features = 0;                 // per picture; 0: FeaturesFor()
  int max_image_size = 1600;        // longer side for detection [px]; 0: full size
  std::string matching = "auto";    // auto, exhaustive, likely or sequential
  std::string mapping = "auto";     // auto, whole, or blocks: overlapping ones, side by side, then joined
  int whole_pictures = 120;         // auto: with more pictures, in blocks; 150 make three of 65
  BlockOptions blocks;
  std::string camera_model = "auto";   // as simple as the data allow, or COLMAP's name of a model
  double retry_minutes = 20;           // ceiling for all further mapping attempts together; 0: none
  std::filesystem::path masks_folder;  // see DetectFeatures; empty: no masks
  int threads = 1;
  io::MemoryBudget memory = io::MemoryBudget();
};

// 4096 features per picture; beyond 400 pictures as many in all as these have, but at least 2048 each. More
// pictures of one place have longer tracks, whose square mapping and adjustment grow with, and need fewer.
int FeaturesFor(std::size_t n_pictures);

struct Unregistered {
  std::string name;
  Refusal refusal;
};

// Wall seconds of each part, all mapping attempts together.
struct ReconstructionTimes {
  double features_s = 0, matching_s = 0, verifying_s = 0, mapping_s = 0, adjusting_s = 0;
};

struct Reconstruction {
  io::ColmapModel model;                // image paths are the pictures' names
  BundleUncertainty uncertainty;        // of cameras and poses, see sfm/bundle/bundle_uncertainty.h
  std::filesystem::path database, log;  // of the mapping attempt that was used, below the work folder
  std::vector<Unregistered> unregistered;
  double triangulation_angle_deg = 0;  // median over the points
  // The camera stood before a background while the subject turned; the background is not part of the model.
  bool turntable = false;
  double stationary_share = 0;  // of the matches, which were removed because they stand still
  ReconstructionTimes times;
  double colmap_cpu_s = 0;         // all mapping attempts
  std::size_t peak_rss_bytes = 0;  // of COLMAP
};

// decide: receives one line for every choice. The result does not depend on `threads`. Throws
// NotReconstructible, and io::Error kMissingTool when COLMAP is missing or
// fails, kNoResources when it runs out of memory, kUsage for an unknown detector, camera model or way of
// matching.
Reconstruction Reconstruct(const std::vector<Picture>& pictures,
                           const std::filesystem::path& images_folder,
                           const std::filesystem::path& work_folder,
                           const ReconstructionOptions& options,
                           const std::function<void(const std::string&)>& decide);

// What the other ranks do for Reconstruct (io/process/shared_work.h), in the same folders: they take part in
// detecting, matching, verifying and mapping in blocks.
void AddReconstructionWorks(const std::filesystem::path& images_folder,
                            const std::filesystem::path& work_folder,
                            const ReconstructionOptions& options,
                            io::ToldWorks* works);

// Reconstruct from given matches on, without stronger settings; of `features` only the keypoints are used.
Reconstruction ReconstructMatches(const std::vector<Picture>& pictures,
                                  const std::vector<Features>& features,
                                  const std::vector<PairMatches>& matches,
                                  const std::filesystem::path& work_folder,
                                  const ReconstructionOptions& options,
                                  const std::function<void(const std::string&)>& decide);

}  // namespace sfm
