#include "sfm/mapping/bridging.h"

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/process/stopwatch.h"
#include "sfm/mapping/found_model.h"
#include "sfm/mapping/joined_model.h"
#include "sfm/mapping/model_joining.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

// The scale of the second part is known to a few per cent at first: tracks that the gap cut in two are found
// only after a first adjustment.
constexpr int kAdjustments = 2;
// With so many pictures in common their points decide, with fewer that picture which has most.
constexpr int kManyShared = 5;

using Pair = std::pair<std::string, std::string>;

std::set<Pair> NamedPairs(const std::vector<std::string>& names, const std::vector<PairMatches>& matches) {
  std::set<Pair> pairs;
  for (const PairMatches& pair : matches)
    pairs.insert(
        std::minmax(names[static_cast<std::size_t>(pair.a)], names[static_cast<std::size_t>(pair.b)]));
  return pairs;
}

// The two sides of a gap, and what becomes of them.
class Gap {
 public:
  Gap(const std::vector<Picture>& pictures,
      const std::vector<std::string>& names,
      const io::ColmapModel& near,
      const fs::path& images_folder,
      const fs::path& folder,
      Colmap* colmap)
      : reader_(pictures), names_(names), images_folder_(images_folder), folder_(folder), colmap_(colmap) {
    for (const io::Frame& frame : near.scene.frames) registered_.insert(frame.image_path.string());
  }

  bool IsAcross(const std::string& a, const std::string& b) const {
    return registered_.count(a) != registered_.count(b);
  }

  // The near side with points of the further keypoints, and with the first pictures behind the gap.
  std::optional<io::ColmapModel> NearSide(const io::ColmapModel& model) const {
    const auto points = Triangulated(model, "near");
    if (!points) return std::nullopt;
    return reader_.Read(colmap_->Continue(images_folder_, *points, n(), true).value_or(*points));
  }

  // Models of the pictures that the near side lacked.
  std::vector<FoundModel> FarSide() const {
    std::vector<std::string> lacking;
    for (const std::string& name : names_) {
      if (registered_.count(name) == 0) lacking.push_back(name);
    }
    return reader_.ReadAll(colmap_->MapBlocks(images_folder_, {lacking}, true).front());
  }

  // Points anew for the poses of the model.
  std::optional<fs::path> Triangulated(const io::ColmapModel& model, const std::string& name) const {
    WritePoses(folder_ / name, names_, model);
    return colmap_->Triangulate(images_folder_, folder_ / name, n());
  }

  // Both sides adjusted together, with points that both see and the pictures that neither could place.
  std::optional<FoundModel> Joined(io::ColmapModel model,
                                   const std::function<void(io::ColmapModel*)>& adjust) const {
    std::optional<fs::path> path;
    for (int i = 0; i < kAdjustments; ++i) {
      adjust(&model);
      // In the end only of what three pictures confirm, as everywhere.
      colmap_->TakeTwoViewTracks(i + 1 < kAdjustments);
      path = Triangulated(model, "joined");
      if (!path) return std::nullopt;
      model = reader_.Read(*path);
    }
    if (static_cast<int>(model.scene.frames.size()) < n())
      path = colmap_->Continue(images_folder_, *path, n(), true).value_or(*path);
    return FoundModel{*path, reader_.Read(*path)};
  }

  const std::set<std::string>& registered() const { return registered_; }

 private:
  int n() const { return static_cast<int>(names_.size()); }

  const ModelReader reader_;
  const std::vector<std::string>& names_;
  std::set<std::string> registered_;
  const fs::path images_folder_, folder_;
  Colmap* colmap_;
};

std::optional<io::Sim3d> Align(const io::ColmapModel& a, const io::ColmapModel& b) {
  return CountShared(a, b) < kManyShared ? AlignAtPicture(a, b) : AlignModels(a, b);
}

}  // namespace

bool IsHeldTogether(const io::Scene& scene, const std::set<std::string>& near) {
  std::vector<bool> is_near;
  for (const io::Frame& frame : scene.frames) is_near.push_back(near.count(frame.image_path.string()) > 0);
  std::vector<int> points_of(scene.frames.size(), 0);
  int across = 0;
  for (const io::Point3D& point : scene.points) {
    std::size_t n_near = 0;
    for (const int frame : point.frame_indices) {
      n_near += is_near[static_cast<std::size_t>(frame)];
      ++points_of[static_cast<std::size_t>(frame)];
    }
    across += n_near > 0 && n_near < point.frame_indices.size();
  }
  for (std::size_t i = 0; i < points_of.size(); ++i) {
    if (!is_near[i] && points_of[i] < kMinHoldingPoints) return false;
  }
  return across >= kMinHoldingPoints;
}

MappingAttempt Bridge(const MappingAttempt& before,
                      const std::vector<Picture>& pictures,
                      std::shared_ptr<const CapturedViews> views,
                      const std::vector<PairMatches>& matches,
                      const fs::path& images_folder,
                      const fs::path& folder,
                      const MappingOptions& options) {
  Colmap colmap(folder, options.threads);
  const io::ColmapModel& model = before.models.front();
  const Gap gap(pictures, before.views->names, model, images_folder, folder, &colmap);
  const std::set<Pair> again = NamedPairs(before.views->names, matches);
  const auto is_matched_again = [&](const std::string& a, const std::string& b) {
    return again.count(std::minmax(a, b)) > 0;
  };
  MappingAttempt attempt = GoOnFrom(
      before,
      std::move(views),
      matches,
      [&](const std::string& a, const std::string& b) {
        return !is_matched_again(a, b) && !gap.IsAcross(a, b);
      },
      &colmap);
  for (const VerifiedPair& pair : before.evidence.pairs) {
    if (gap.IsAcross(pair.name_a, pair.name_b) && !is_matched_again(pair.name_a, pair.name_b))
      attempt.evidence.pairs.push_back(pair);
  }

  const io::Stopwatch mapping;
  // Next to a gap there are few pictures that could confirm a match of two.
  colmap.TakeTwoViewTracks(true);
  if (const auto near = gap.NearSide(model)) {
    JoinedModel joined(attempt.views->groups, *near);
    for (const FoundModel& far : gap.FarSide()) {
      const auto near_from_far = Align(*near, far.model);
      if (!near_from_far) continue;
      joined.Add(far.model, *near_from_far);
      ++attempt.n_joined;
    }
    std::optional<FoundModel> found;
    if (attempt.n_joined > 0) found = gap.Joined(*joined.model(), options.adjust_joined);
    if (found && IsHeldTogether(found->model.scene, gap.registered())) {
      attempt.models = {std::move(found->model)};
      attempt.largest = found->path;
    }
  }
  attempt.mapping_s = mapping.seconds();
  attempt.cpu_s = colmap.cpu_s();
  attempt.peak_rss_bytes = colmap.peak_rss_bytes();
  return attempt;
}

}  // namespace sfm
