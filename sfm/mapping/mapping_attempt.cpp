#include "sfm/mapping/mapping_attempt.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/base/stopwatch.h"
#include "sfm/mapping/flat_pairs.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMinMatches = 15;  // COLMAP's --TwoViewGeometry.min_num_inliers
constexpr int kMinSharedPictures = 3;    // three centres fix a similarity
// Merged models may fit a little worse than the better of the two.
constexpr double kMergedErrorGrowth = 1.1;

io::ColmapModel ReadModel(const fs::path& folder, const std::map<std::string, const Picture*>& by_name) {
  io::ColmapModel model = io::ReadColmapModel(folder);
  for (const io::Frame& frame : model.scene.frames) {
    const auto picture = by_name.find(frame.image_path.string());
    const io::Camera& camera = model.scene.cameras[static_cast<std::size_t>(frame.camera_index)];
    if (picture == by_name.end() || picture->second->width != camera.width ||
        picture->second->height != camera.height) {
      throw io::Error(io::ExitCode::kMissingTool,
                      "colmap mapper reported success but its model " + folder.string() + " holds " +
                          frame.image_path.string() +
                          ", which is not a picture of this capture or has another size");
    }
  }
  return model;
}

// Whoever compares rays looks keypoints up by these indices.
void CheckMatches(const CaptureEvidence& evidence) {
  std::map<std::string, int> counts;
  for (const PictureFeatures& picture : evidence.features) counts[picture.name] = picture.count;
  for (const VerifiedPair& pair : evidence.pairs) {
    const int n_a = counts[pair.name_a], n_b = counts[pair.name_b];
    for (const auto& [a, b] : pair.matches) {
      if (a >= 0 && a < n_a && b >= 0 && b < n_b) continue;
      throw io::Error(io::ExitCode::kMissingTool,
                      "colmap verified a match of " + pair.name_a + " and " + pair.name_b +
                          " between keypoints that do not exist",
                      "Install a COLMAP from 3.8 to 4.x (apt-get install colmap)");
    }
  }
}

std::set<std::string> FrameNames(const io::ColmapModel& model) {
  std::set<std::string> names;
  for (const io::Frame& frame : model.scene.frames) names.insert(frame.image_path.string());
  return names;
}

int CountShared(const io::ColmapModel& a, const io::ColmapModel& b) {
  const std::set<std::string> names = FrameNames(a);
  return static_cast<int>(
      std::count_if(b.scene.frames.begin(), b.scene.frames.end(), [&](const io::Frame& frame) {
        return names.count(frame.image_path.string()) > 0;
      }));
}

std::vector<PairMatches> WithEnoughMatches(const std::vector<PairMatches>& matches) {
  std::vector<PairMatches> enough;
  for (const PairMatches& pair : matches) {
    if (pair.matches.size() >= kMinMatches) enough.push_back(pair);
  }
  return enough;
}

std::map<std::string, const Picture*> ByName(const std::vector<Picture>& pictures) {
  std::map<std::string, const Picture*> by_name;
  for (const Picture& picture : pictures) by_name[picture.name] = &picture;
  return by_name;
}

void ReadEvidence(const Colmap& colmap, MappingAttempt* attempt) {
  attempt->evidence = {Summaries(attempt->views->names, attempt->views->features),
                       ReadVerifiedPairs(colmap.database())};
  CheckMatches(attempt->evidence);
  DistinguishFlatPairs(*attempt->views, &attempt->evidence.pairs);
}

}  // namespace

std::vector<CameraGroup> CameraGroups(const std::vector<Picture>& pictures) {
  std::map<std::string, std::vector<const Picture*>> by_key;
  for (const Picture& picture : pictures) {
    by_key[fmt::format("{}/{}x{}", picture.camera_group, picture.width, picture.height)].push_back(&picture);
  }
  std::vector<CameraGroup> groups;
  for (const auto& [key, members] : by_key) {
    CameraGroup group{.width = members.front()->width, .height = members.front()->height};
    std::vector<double> focals;
    for (const Picture* picture : members) {
      group.names.push_back(picture->name);
      if (picture->focal_px > 0) focals.push_back(picture->focal_px);
    }
    if (!focals.empty()) group.focal_px = io::Median(focals);
    groups.push_back(std::move(group));
  }
  return groups;
}

std::vector<std::string> Names(const std::vector<Picture>& pictures) {
  std::vector<std::string> names;
  for (const Picture& picture : pictures) names.push_back(picture.name);
  return names;
}

MappingAttempt Attempt(const std::vector<Picture>& pictures,
                       std::shared_ptr<const CapturedViews> views,
                       std::vector<PairMatches> matches,
                       const fs::path& images_folder,
                       const fs::path& folder,
                       bool relaxed,
                       int threads) {
  Colmap colmap(folder, threads);
  MappingAttempt attempt{.views = std::move(views),
                         .matches = std::move(matches),
                         .database = colmap.database(),
                         .log = folder / "colmap.log"};
  const io::Stopwatch verifying;
  colmap.VerifyMatches(*attempt.views, WithEnoughMatches(attempt.matches));
  ReadEvidence(colmap, &attempt);
  attempt.verifying_s = verifying.seconds();

  const io::Stopwatch mapping;
  const std::map<std::string, const Picture*> by_name = ByName(pictures);
  std::vector<std::pair<fs::path, io::ColmapModel>> models;
  for (const fs::path& path : colmap.Map(images_folder, static_cast<int>(pictures.size()), relaxed)) {
    models.emplace_back(path, ReadModel(path, by_name));
  }
  const auto largest_first = [](const auto& a, const auto& b) {
    return a.second.scene.frames.size() > b.second.scene.frames.size();
  };
  std::stable_sort(models.begin(), models.end(), largest_first);
  for (std::size_t i = 1; i < models.size(); ++i) {
    if (CountShared(models[0].second, models[i].second) < kMinSharedPictures) continue;
    const std::optional<fs::path> path = colmap.Merge(models[0].first, models[i].first);
    if (!path) continue;
    io::ColmapModel merged = ReadModel(*path, by_name);
    const double error =
        std::max(models[0].second.mean_reprojection_error_px, models[i].second.mean_reprojection_error_px);
    if (merged.scene.frames.size() > models[0].second.scene.frames.size() &&
        merged.mean_reprojection_error_px <= kMergedErrorGrowth * error) {
      models[0] = {*path, std::move(merged)};
      models.erase(models.begin() + static_cast<std::ptrdiff_t>(i--));
    }
  }
  if (!models.empty()) attempt.largest = models.front().first;
  for (auto& [path, model] : models) attempt.models.push_back(std::move(model));
  attempt.mapping_s = mapping.seconds();
  attempt.cpu_s = colmap.cpu_s();
  attempt.peak_rss_bytes = colmap.peak_rss_bytes();
  return attempt;
}

MappingAttempt Continue(const MappingAttempt& before,
                        const std::vector<Picture>& pictures,
                        std::shared_ptr<const CapturedViews> views,
                        const std::vector<PairMatches>& matches,
                        const std::vector<std::string>& changed,
                        const fs::path& images_folder,
                        const fs::path& folder,
                        int threads) {
  Colmap colmap(folder, threads);
  MappingAttempt attempt{.views = std::move(views),
                         .models = before.models,
                         .largest = before.largest,
                         .database = colmap.database(),
                         .log = folder / "colmap.log"};
  const std::set<std::string> names(changed.begin(), changed.end());
  for (const PairMatches& pair : before.matches) {
    const std::string &a = attempt.views->names[static_cast<std::size_t>(pair.a)],
                      &b = attempt.views->names[static_cast<std::size_t>(pair.b)];
    if (names.count(a) + names.count(b) == 0) attempt.matches.push_back(pair);
  }
  attempt.matches.insert(attempt.matches.end(), matches.begin(), matches.end());
  const io::Stopwatch verifying;
  colmap.VerifyMatches(*attempt.views, WithEnoughMatches(matches));
  CopyPairsWithout(before.database, colmap.database(), changed);
  ReadEvidence(colmap, &attempt);
  attempt.verifying_s = verifying.seconds();

  const io::Stopwatch mapping;
  const auto path = colmap.Continue(images_folder, before.largest, static_cast<int>(pictures.size()));
  if (path) {
    io::ColmapModel model = ReadModel(*path, ByName(pictures));
    if (static_cast<int>(model.scene.frames.size()) > before.Registered()) {
      attempt.models = {std::move(model)};
      attempt.largest = *path;
    }
  }
  attempt.mapping_s = mapping.seconds();
  attempt.cpu_s = colmap.cpu_s();
  attempt.peak_rss_bytes = colmap.peak_rss_bytes();
  return attempt;
}

}  // namespace sfm
