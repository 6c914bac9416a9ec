// A model that grows by others.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "io/scene/colmap_model.h"
#include "sfm/colmap/colmap_database.h"
#include "sfm/mapping/found_model.h"

namespace sfm {

// Its cameras are those of CapturedViews::groups, in their order.
class JoinedModel {
 public:
  JoinedModel(const std::vector<CameraGroup>& groups, const io::ColmapModel& first);

  void Add(const io::ColmapModel& model, const io::Sim3d& joined_from_model);

  // Takes out of `models` what AlignModels can join, always that which shares most pictures with what is
  // joined so far.
  void JoinAll(std::vector<FoundModel>* models);

  io::ColmapModel* model() { return &joined_; }

 private:
  const std::map<std::string, int> camera_of_;
  std::vector<bool> known_;  // of each camera
  io::ColmapModel joined_;
};

// The poses alone; pictures are numbered as in COLMAP's database.
void WritePoses(const std::filesystem::path& folder,
                const std::vector<std::string>& names,
                const io::ColmapModel& model);

}  // namespace sfm
