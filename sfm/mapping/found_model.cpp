#include "sfm/mapping/found_model.h"

#include <algorithm>
#include <optional>
#include <set>

#include "io/base/error.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

constexpr int kMinSharedPictures = 3;  // three centres fix a similarity
// Merged models may fit a little worse than the better of the two.
constexpr double kMergedErrorGrowth = 1.1;

std::set<std::string> FrameNames(const io::ColmapModel& model) {
  std::set<std::string> names;
  for (const io::Frame& frame : model.scene.frames) names.insert(frame.image_path.string());
  return names;
}

}  // namespace

ModelReader::ModelReader(const std::vector<Picture>& pictures) {
  for (const Picture& picture : pictures) by_name_[picture.name] = &picture;
}

io::ColmapModel ModelReader::Read(const fs::path& path) const {
  io::ColmapModel model = io::ReadColmapModel(path);
  for (const io::Frame& frame : model.scene.frames) {
    const auto picture = by_name_.find(frame.image_path.string());
    const io::Camera& camera = model.scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    if (picture == by_name_.end() || picture->second->width != camera.width ||
        picture->second->height != camera.height) {
      throw io::Error(io::ExitCode::kMissingTool,
                      "colmap mapper reported success but its model " + path.string() + " holds " +
                          frame.image_path.string() +
                          ", which is not a picture of this capture or has another size");
    }
  }
  return model;
}

std::vector<FoundModel> ModelReader::ReadAll(const std::vector<fs::path>& paths) const {
  std::vector<FoundModel> models;
  for (const fs::path& path : paths) models.push_back({path, Read(path)});
  std::stable_sort(models.begin(), models.end(), [](const FoundModel& a, const FoundModel& b) {
    return a.model.scene.frames.size() > b.model.scene.frames.size();
  });
  return models;
}

int CountShared(const io::ColmapModel& a, const io::ColmapModel& b) {
  const std::set<std::string> names = FrameNames(a);
  return static_cast<int>(
      std::count_if(b.scene.frames.begin(), b.scene.frames.end(), [&](const io::Frame& frame) {
        return names.count(frame.image_path.string()) > 0;
      }));
}

void MergeIntoLargest(Colmap* colmap, const ModelReader& reader, std::vector<FoundModel>* models) {
  for (std::size_t i = 1; i < models->size(); ++i) {
    FoundModel &largest = models->front(), &other = (*models)[i];
    if (CountShared(largest.model, other.model) < kMinSharedPictures) continue;
    const std::optional<fs::path> path = colmap->Merge(largest.path, other.path);
    if (!path) continue;
    io::ColmapModel merged = reader.Read(*path);
    const double error =
        std::max(largest.model.mean_reprojection_error_px, other.model.mean_reprojection_error_px);
    if (merged.scene.frames.size() > largest.model.scene.frames.size() &&
        merged.mean_reprojection_error_px <= kMergedErrorGrowth * error) {
      largest = {*path, std::move(merged)};
      models->erase(models->begin() + static_cast<std::ptrdiff_t>(i--));
    }
  }
}

}  // namespace sfm
