// What rank 0 tells others of COLMAP's work (io/process/shared_work.h). folder: the name of the work folder.
#pragma once

#include <string>
#include <vector>

#include "sfm/colmap/colmap.h"

namespace sfm {

constexpr const char *kVerifyWork = "verify", *kMapWork = "map";

struct VerifyingMessage {
  std::string folder;
  CapturedViews views;  // without descriptors
  std::vector<std::vector<PairMatches>> shards;
};
std::string TellVerifying(const std::string& folder,
                          const CapturedViews& views,
                          const std::vector<std::vector<PairMatches>>& shards);
VerifyingMessage ToldVerifying(const std::string& bytes);

struct MappingMessage {
  std::string folder;
  std::vector<std::vector<std::string>> blocks;
  bool has_images = false, relaxed = false, take_two_view_tracks = false;
};
std::string TellMapping(const MappingMessage& message);
MappingMessage ToldMapping(const std::string& bytes);

}  // namespace sfm
