#include "sfm/mapping/joined_model.h"

#include <algorithm>
#include <cstdint>

#include "sfm/mapping/model_joining.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

// Each picture's camera, counted as in CapturedViews::groups.
std::map<std::string, int> CameraOf(const std::vector<CameraGroup>& groups) {
  std::map<std::string, int> camera_of;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    for (const std::string& name : groups[i].names) camera_of[name] = static_cast<int>(i);
  }
  return camera_of;
}

}  // namespace

JoinedModel::JoinedModel(const std::vector<CameraGroup>& groups, const io::ColmapModel& first)
    : camera_of_(CameraOf(groups)), known_(groups.size(), false) {
  joined_.camera_model = first.camera_model;
  for (const CameraGroup& group : groups) {
    const double focal = FocalOrGuess(group);
    joined_.scene.cameras.push_back({.width = group.width,
                                     .height = group.height,
                                     .fl_x = focal,
                                     .fl_y = focal,
                                     .cx = group.width / 2.0,
                                     .cy = group.height / 2.0});
  }
  Add(first, {});
}

void JoinedModel::Add(const io::ColmapModel& model, const io::Sim3d& joined_from_model) {
  std::vector<int> cameras;
  for (const io::Frame& frame : model.scene.frames) {
    const int camera = camera_of_.at(frame.image_path.string());
    const auto i = static_cast<std::size_t>(camera);
    if (!known_[i])
      joined_.scene.cameras[i] = model.scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    known_[i] = true;
    cameras.push_back(camera);
  }
  AddModel(model, joined_from_model, cameras, &joined_);
}

void JoinedModel::JoinAll(std::vector<FoundModel>* models) {
  for (bool grew = true; grew;) {
    grew = false;
    std::stable_sort(models->begin(), models->end(), [&](const FoundModel& a, const FoundModel& b) {
      return CountShared(joined_, a.model) > CountShared(joined_, b.model);
    });
    for (std::size_t i = 0; i < models->size() && !grew; ++i) {
      const auto joined_from_block = AlignModels(joined_, (*models)[i].model);
      if (!joined_from_block) continue;
      Add((*models)[i].model, *joined_from_block);
      models->erase(models->begin() + static_cast<std::ptrdiff_t>(i));
      grew = true;
    }
  }
}

void WritePoses(const fs::path& folder, const std::vector<std::string>& names, const io::ColmapModel& model) {
  std::map<std::string, std::uint32_t> number;
  for (const std::string& name : names) number.emplace(name, static_cast<std::uint32_t>(number.size() + 1));
  std::vector<std::uint32_t> ids;
  for (const io::Frame& frame : model.scene.frames) ids.push_back(number.at(frame.image_path.string()));
  const io::ColmapModel poses{.scene = {.cameras = model.scene.cameras, .frames = model.scene.frames}};
  fs::create_directories(folder);
  io::WriteColmapModel(folder, poses, io::ColmapForm::kText, ids);
}

}  // namespace sfm
