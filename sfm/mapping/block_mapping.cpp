#include "sfm/mapping/block_mapping.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <string>

#include "sfm/mapping/joined_model.h"

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

  JoinedModel joined_model(views.groups, models.front().model);
  std::vector<FoundModel> others(std::make_move_iterator(models.begin() + 1),
                                 std::make_move_iterator(models.end()));
  joined_model.JoinAll(&others);
  attempt->n_joined = attempt->n_blocks - others.size();
  options.adjust_joined(joined_model.model());
  const fs::path poses = models.front().path.parent_path() / "joined";
  WritePoses(poses, views.names, *joined_model.model());

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
