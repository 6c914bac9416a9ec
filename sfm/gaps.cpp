#include "sfm/gaps.h"

#include <algorithm>
#include <limits>

#include "io/base/median.h"
#include "sfm/second_look.h"

namespace sfm {
namespace {

constexpr std::size_t kMinPart = 3;

}  // namespace

std::vector<int> AroundGaps(const MappingAttempt& attempt) {
  const std::vector<int> lacking = LeftOutPictures(attempt);
  if (lacking.size() < kMinPart) return {};
  const int n = static_cast<int>(attempt.views->names.size());
  std::set<int> around(lacking.begin(), lacking.end());
  for (const int i : lacking) {
    for (int k = std::max(0, i - kFollowing); k <= std::min(n - 1, i + kFollowing); ++k) around.insert(k);
  }
  if (around.size() == lacking.size()) return {};
  return {around.begin(), around.end()};
}

ImagePairs FollowingPairs(const std::vector<int>& pictures) {
  ImagePairs pairs;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    for (std::size_t k = i + 1; k < pictures.size() && pictures[k] - pictures[i] <= kFollowing; ++k)
      pairs.emplace(pictures[i], pictures[k]);
  }
  return pairs;
}

double MedianRotationDeg(const io::ColmapModel& model,
                         const BundleUncertainty& uncertainty,
                         const std::set<std::string>& names) {
  std::vector<double> rotations;
  for (std::size_t i = 0; i < uncertainty.poses.size(); ++i) {
    if (names.count(model.scene.frames[i].image_path.string()) > 0)
      rotations.push_back(uncertainty.poses[i].rotation_deg);
  }
  return rotations.empty() ? std::numeric_limits<double>::infinity() : io::Median(rotations);
}

void AddFeatures(const std::vector<Features>& added,
                 const std::vector<PairMatches>& added_matches,
                 std::vector<Features>* features,
                 std::vector<PairMatches>* matches) {
  std::vector<int> before;
  for (std::size_t i = 0; i < added.size(); ++i) {
    Features& picture = (*features)[i];
    before.push_back(static_cast<int>(picture.keypoints.size()));
    picture.keypoints.insert(picture.keypoints.end(), added[i].keypoints.begin(), added[i].keypoints.end());
    picture.descriptors.insert(
        picture.descriptors.end(), added[i].descriptors.begin(), added[i].descriptors.end());
  }
  for (std::size_t i = 0; i < added_matches.size(); ++i) {
    PairMatches& pair = (*matches)[i];
    const int a = before[static_cast<std::size_t>(pair.a)], b = before[static_cast<std::size_t>(pair.b)];
    for (const auto& [in_a, in_b] : added_matches[i].matches) pair.matches.push_back({in_a + a, in_b + b});
  }
}

}  // namespace sfm
