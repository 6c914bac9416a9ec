#include "sfm/mapping/mapping_attempt.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "io/base/error.h"
#include "io/base/median.h"
#include "io/process/stopwatch.h"
#include "sfm/mapping/block_mapping.h"
#include "sfm/mapping/flat_pairs.h"
#include "sfm/mapping/found_model.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

std::vector<PairMatches> WithEnoughMatches(const std::vector<PairMatches>& matches) {
  std::vector<PairMatches> enough;
  for (const PairMatches& pair : matches) {
    if (pair.matches.size() >= kLeastTwoViewMatches) enough.push_back(pair);
  }
  return enough;
}

void ReadEvidence(const Colmap& colmap, MappingAttempt* attempt) {
  attempt->evidence = {Summaries(attempt->views->names, attempt->views->features),
                       ReadVerifiedPairs(colmap.database())};
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
                       const MappingOptions& options) {
  Colmap colmap(folder, options.threads);
  MappingAttempt attempt{.views = std::move(views),
                         .matches = std::move(matches),
                         .database = colmap.database(),
                         .log = folder / "colmap.log"};
  const io::Stopwatch verifying;
  colmap.VerifyMatches(*attempt.views, WithEnoughMatches(attempt.matches));
  ReadEvidence(colmap, &attempt);
  attempt.verifying_s = verifying.seconds();

  const io::Stopwatch mapping;
  const ModelReader reader(pictures);
  std::vector<FoundModel> models =
      options.adjust_joined
          ? MapInBlocks(&colmap, reader, images_folder, options, &attempt)
          : reader.ReadAll(colmap.Map(images_folder, static_cast<int>(pictures.size()), options.relaxed));
  if (!options.adjust_joined) MergeIntoLargest(&colmap, reader, &models);
  if (!models.empty()) attempt.largest = models.front().path;
  for (FoundModel& found : models) attempt.models.push_back(std::move(found.model));
  attempt.mapping_s = mapping.seconds();
  attempt.cpu_s = colmap.cpu_s();
  attempt.peak_rss_bytes = colmap.peak_rss_bytes();
  return attempt;
}

MappingAttempt GoOnFrom(const MappingAttempt& before,
                        std::shared_ptr<const CapturedViews> views,
                        const std::vector<PairMatches>& matches,
                        const PairFilter& takes,
                        Colmap* colmap) {
  MappingAttempt attempt{.views = std::move(views),
                         .models = before.models,
                         .largest = before.largest,
                         .database = colmap->database(),
                         .log = colmap->database().parent_path() / "colmap.log"};
  const auto name = [&](int i) { return attempt.views->names[static_cast<std::size_t>(i)]; };
  for (const PairMatches& pair : before.matches) {
    if (takes(name(pair.a), name(pair.b))) attempt.matches.push_back(pair);
  }
  attempt.matches.insert(attempt.matches.end(), matches.begin(), matches.end());
  const io::Stopwatch verifying;
  colmap->VerifyMatches(*attempt.views, WithEnoughMatches(matches));
  CopyPairs(before.database, colmap->database(), takes);
  ReadEvidence(*colmap, &attempt);
  attempt.verifying_s = verifying.seconds();
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
  const std::set<std::string> names(changed.begin(), changed.end());
  MappingAttempt attempt = GoOnFrom(
      before,
      std::move(views),
      matches,
      [&](const std::string& a, const std::string& b) { return names.count(a) + names.count(b) == 0; },
      &colmap);

  const io::Stopwatch mapping;
  const auto path = colmap.Continue(images_folder, before.largest, static_cast<int>(pictures.size()), true);
  if (path) {
    io::ColmapModel model = ModelReader(pictures).Read(*path);
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
