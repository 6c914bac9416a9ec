// What rank 0 tells others of COLMAP's work (io/process/shared_work.h). folder: the name of the work folder.
#pragma once

#include <string>
#include <vector>

namespace sfm {

constexpr const char* kMapWork = "map";

struct MappingMessage {
  std::string folder;
  std::vector<std::vector<std::string>> blocks;
  bool has_images = false, relaxed = false, take_two_view_tracks = false;
};
std::string TellMapping(const MappingMessage& message);
MappingMessage ToldMapping(const std::string& bytes);

}  // namespace sfm
