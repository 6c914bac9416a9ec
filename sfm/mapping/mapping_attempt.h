// A mapping attempt: given matches are verified, COLMAP maps them, and the models it wrote are read.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "io/scene/colmap_model.h"
#include "sfm/colmap/colmap.h"
#include "sfm/features/matching.h"
#include "sfm/features/picture.h"
#include "sfm/mapping/capture_blocks.h"
#include "sfm/mapping/diagnosis.h"

namespace sfm {

struct MappingAttempt {
  // What it was made from: a later attempt may have other keypoints.
  std::shared_ptr<const CapturedViews> views;
  std::vector<PairMatches> matches;
  CaptureEvidence evidence;
  std::vector<io::ColmapModel> models;  // largest first
  std::filesystem::path largest;        // folder of the first one, as COLMAP wrote it
  std::filesystem::path database, log;
  std::size_t n_blocks = 0,
              n_joined = 0;  // models of blocks, and those in the first model; 0: mapped as a whole
  double verifying_s = 0, mapping_s = 0;  // wall
  double cpu_s = 0;
  std::size_t peak_rss_bytes = 0;

  int Registered() const { return models.empty() ? 0 : static_cast<int>(models.front().scene.frames.size()); }
};

// One camera per group and size: a camera shared by pictures of different sizes is refused by COLMAP.
std::vector<CameraGroup> CameraGroups(const std::vector<Picture>& pictures);

std::vector<std::string> Names(const std::vector<Picture>& pictures);

struct MappingOptions {
  bool relaxed = false;  // see Colmap::Map
  // When set, pictures are mapped in overlapping blocks, and this adjusts the cameras of the model that joins
  // them. Its cameras are those of CapturedViews::groups.
  std::function<void(io::ColmapModel*)> adjust_joined;
  BlockOptions blocks;
  int threads = 1;
};

// folder: private. images_folder: see Colmap::Map. Models that share at least 3 pictures are merged when the
// union fits as well. Pairs with fewer than 15 matches are left out, as COLMAP would.
MappingAttempt Attempt(const std::vector<Picture>& pictures,
                       std::shared_ptr<const CapturedViews> views,
                       std::vector<PairMatches> matches,
                       const std::filesystem::path& images_folder,
                       const std::filesystem::path& folder,
                       const MappingOptions& options);

// The beginning of an attempt that goes on from `before` and has its models so far: `matches` are verified,
// and the pairs to be taken are taken over as they were verified before. `views` have the keypoints of those.
MappingAttempt GoOnFrom(const MappingAttempt& before,
                        std::shared_ptr<const CapturedViews> views,
                        const std::vector<PairMatches>& matches,
                        const PairFilter& takes,
                        Colmap* colmap);

// Goes on from the largest model of `before`: `views` may have new keypoints for the pictures `changed` only,
// and `matches` are all the pairs that touch these. The other pairs are taken over as verified. Its models
// are those of `before` when COLMAP could not add a picture.
MappingAttempt Continue(const MappingAttempt& before,
                        const std::vector<Picture>& pictures,
                        std::shared_ptr<const CapturedViews> views,
                        const std::vector<PairMatches>& matches,
                        const std::vector<std::string>& changed,
                        const std::filesystem::path& images_folder,
                        const std::filesystem::path& folder,
                        int threads);

}  // namespace sfm
