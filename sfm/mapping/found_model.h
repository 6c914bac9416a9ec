// A model that COLMAP wrote, read and checked.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "io/scene/colmap_model.h"
#include "sfm/colmap/colmap.h"
#include "sfm/features/picture.h"

namespace sfm {

struct FoundModel {
  std::filesystem::path path;  // as COLMAP wrote it
  io::ColmapModel model;
};

class ModelReader {
 public:
  // The pictures must outlive the reader.
  explicit ModelReader(const std::vector<Picture>& pictures);

  // Throws kMissingTool when the model holds anything but pictures of the capture in their size.
  io::ColmapModel Read(const std::filesystem::path& path) const;

  // Those with most pictures come first.
  std::vector<FoundModel> ReadAll(const std::vector<std::filesystem::path>& paths) const;

 private:
  std::map<std::string, const Picture*> by_name_;
};

int CountShared(const io::ColmapModel& a, const io::ColmapModel& b);

// Lets COLMAP merge into the first model those of the others that share at least 3 pictures with it, when the
// union has more pictures and fits about as well.
void MergeIntoLargest(Colmap* colmap, const ModelReader& reader, std::vector<FoundModel>* models);

}  // namespace sfm
