#include "sfm/mapping/pair_agreement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

namespace sfm {
namespace {

// Good captures reach 0.07 (repeated texture far apart), and nothing between following pictures; folded
// models begin at 0.16 and 0.19.
constexpr double kMaxContradictingShare = 0.15, kMaxFollowingContradictingShare = 0.1;
constexpr double kMaxErrorPx = 8;  // twice what COLMAP accepts in a pair: poses have errors, too
constexpr double kMinAgreeingMatches = 0.5;
constexpr int kFollowing = 3;

// A registered picture: its keypoints as unit rays in the world.
struct View {
  int position = 0;  // in the order of the names
  const io::Camera* camera = nullptr;
  const io::Rigid3d* world_from_cam = nullptr;
  const Features* features = nullptr;

  std::optional<Eigen::Vector3d> Ray(int keypoint) const {
    const Keypoint& k = features->keypoints[static_cast<std::size_t>(keypoint)];
    const auto ray = io::RayFromImg(*camera, {k.x, k.y});
    if (!ray) return std::nullopt;
    return world_from_cam->rotation * *ray;
  }
};

bool Agrees(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& t, double tolerance) {
  const Eigen::Vector3d across = a.cross(b);
  const double sine = across.norm();
  if (sine <= tolerance) return true;  // a point far away
  const double miss = std::abs(t.dot(across)), scale = std::hypot(t.cross(a).norm(), t.cross(b).norm());
  if (miss > tolerance * scale) return false;
  // Depths along both rays, up to a common factor: depth_a a - depth_b b = t but for the miss.
  const double depth_a = t.cross(b).dot(across), depth_b = t.cross(a).dot(across);
  return depth_a > 0 && depth_b > 0;
}

bool Contradicts(const View& a, const View& b, const VerifiedPair& pair) {
  const Eigen::Vector3d t = b.world_from_cam->translation - a.world_from_cam->translation;
  const double tolerance = kMaxErrorPx / std::min(a.camera->fl_x, b.camera->fl_x);
  int tested = 0, agreeing = 0;
  for (const auto& [in_a, in_b] : pair.matches) {
    const auto ray_a = a.Ray(in_a), ray_b = b.Ray(in_b);
    if (!ray_a || !ray_b) continue;
    ++tested;
    agreeing += Agrees(*ray_a, *ray_b, t, tolerance);
  }
  return agreeing < kMinAgreeingMatches * tested;
}

}  // namespace

bool PairAgreement::Contradicts() const {
  return contradicting_share > kMaxContradictingShare ||
         following_contradicting_share > kMaxFollowingContradictingShare;
}

std::string PairAgreement::Figures() const {
  return fmt::format(
      "{} % of all matches and {} % of those between following pictures contradict the poses found ({} of {} "
      "pairs)",
      std::lround(100 * contradicting_share),
      std::lround(100 * following_contradicting_share),
      contradicting,
      pairs);
}

PairAgreement CompareWithPairs(const io::Scene& scene,
                               const std::vector<std::string>& names,
                               const std::vector<Features>& features,
                               const std::vector<VerifiedPair>& pairs) {
  std::map<std::string, View> views;
  for (const io::Frame& frame : scene.frames) {
    views[frame.image_path.string()] = {
        0, &scene.cameras[static_cast<std::size_t>(frame.camera_index)], &frame.world_from_cam};
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto view = views.find(names[i]);
    if (view == views.end()) continue;
    view->second.position = static_cast<int>(i);
    view->second.features = &features[i];
  }
  PairAgreement agreement;
  struct Sum {
    double inliers = 0, contradicting = 0;
    double Share() const { return inliers > 0 ? contradicting / inliers : 0; }
  } all, following;
  for (const VerifiedPair& pair : pairs) {
    const auto a = views.find(pair.name_a), b = views.find(pair.name_b);
    if (a == views.end() || b == views.end()) continue;
    const bool contradicts = Contradicts(a->second, b->second, pair);
    ++agreement.pairs;
    agreement.contradicting += contradicts;
    for (Sum* sum : {&all, &following}) {
      if (sum == &following && std::abs(a->second.position - b->second.position) > kFollowing) continue;
      sum->inliers += pair.inliers;
      sum->contradicting += contradicts ? pair.inliers : 0;
    }
  }
  agreement.contradicting_share = all.Share();
  agreement.following_contradicting_share = following.Share();
  return agreement;
}

}  // namespace sfm
