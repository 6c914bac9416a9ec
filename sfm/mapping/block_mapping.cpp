#include "sfm/mapping/block_mapping.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <string>

#include "sfm/mapping/model_joining.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

std::vector<std::vector<std::string>> NamedBlocks(const MappingAttempt& attempt,
                                                  const BlockOptions& options) {
  const std::vector<std::string>& names = attempt.views->names;
  std::map<std::string, int> index;
  for (std::size_t i = 0; i < names.size(); ++i) index[names[i]] = static_cast<int>(i);
  std::vector<PictureLink> links;
  for (const VerifiedPair& pair : attempt.evidence.pairs)
    links.push_back({index.at(pair.name_a), index.at(pair.name_b), static_cast<double>(pair.inliers)});
  std::vector<std::vector<std::string>> blocks;
  for (const std::vector<int>& block : OverlappingBlocks(static_cast<int>(names.size()), links, options)) {
    blocks.emplace_back();
    for (const int i : block) blocks.back().push_back(names[static_cast<std::size_t>(i)]);
  }
  return blocks;
}

// Each picture's camera, counted as in CapturedViews::groups.
std::map<std::string, int> CameraOf(const std::vector<CameraGroup>& groups) {
  std::map<std::string, int> camera_of;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    for (const std::string& name : groups[i].names) camera_of[name] = static_cast<int>(i);
  }
  return camera_of;
}

// Joins models to the first one, always that which shares most pictures with what is joined so far.
class Joiner {
 public:
  Joiner(const std::vector<CameraGroup>& groups, const io::ColmapModel& first)
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

  // Takes what it can join out of `models`.
  void JoinAll(std::vector<FoundModel>* models) {
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

  io::ColmapModel* joined() { return &joined_; }

 private:
  void Add(const io::ColmapModel& model, const io::Sim3d& joined_from_model) {
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

  const std::map<std::string, int> camera_of_;
  std::vector<bool> known_;  // of each camera
  io::ColmapModel joined_;
};

// The poses alone; pictures are numbered as in COLMAP's database.
void WritePoses(const fs::path& folder, const std::vector<std::string>& names, const io::ColmapModel& model) {
  std::map<std::string, std::uint32_t> number;
  for (const std::string& name : names) number.emplace(name, static_cast<std::uint32_t>(number.size() + 1));
  std::vector<std::uint32_t> ids;
  for (const io::Frame& frame : model.scene.frames) ids.push_back(number.at(frame.image_path.string()));
  const io::ColmapModel poses{.scene = {.cameras = model.scene.cameras, .frames = model.scene.frames}};
  fs::create_directories(folder);
  io::WriteColmapModel(folder, poses, io::ColmapForm::kText, ids);
}

}  // namespace

std::vector<FoundModel> MapInBlocks(Colmap* colmap,
                                    const ModelReader& reader,
                                    const fs::path& images_folder,
                                    const MappingOptions& options,
                                    MappingAttempt* attempt) {
  const CapturedViews& views = *attempt->views;
  std::vector<fs::path> paths;
  for (const auto& found :
       colmap->MapBlocks(images_folder, NamedBlocks(*attempt, options.blocks), options.relaxed))
    paths.insert(paths.end(), found.begin(), found.end());
  std::vector<FoundModel> models = reader.ReadAll(paths);
  attempt->n_blocks = models.size();
  if (models.size() < 2) return models;

  Joiner joiner(views.groups, models.front().model);
  std::vector<FoundModel> others(std::make_move_iterator(models.begin() + 1),
                                 std::make_move_iterator(models.end()));
  joiner.JoinAll(&others);
  attempt->n_joined = attempt->n_blocks - others.size();
  options.adjust_joined(joiner.joined());
  const fs::path poses = models.front().path.parent_path() / "joined";
  WritePoses(poses, views.names, *joiner.joined());

  const int n = static_cast<int>(views.names.size());
  std::optional<fs::path> path = colmap->Triangulate(images_folder, poses, n);
  if (!path) {
    attempt->n_joined = 0;
    return reader.ReadAll(paths);
  }
  FoundModel joined{*path, reader.Read(*path)};
  if (static_cast<int>(joined.model.scene.frames.size()) < n) {
    path = colmap->Continue(images_folder, joined.path, n, options.relaxed);
    if (path) joined = {*path, reader.Read(*path)};
  }
  others.insert(others.begin(), std::move(joined));
  return others;
}

}  // namespace sfm
