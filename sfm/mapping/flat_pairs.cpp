#include "sfm/mapping/flat_pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "io/base/median.h"
#include "io/scene/decomposition.h"

namespace sfm {
namespace {

// By how much metadata misstate a focal length: stabilised video and digital zoom crop up to a fifth.
constexpr double kKnownFocalFactor = 1.25;
// The guess of 1.2 times the longer side is a lens of 43 mm (35 mm equivalent): 22 to 65 mm cover phones,
// drones and standard zooms. With a longer lens a rotation and a shift over a plane look ever more alike.
constexpr double kLeastGuessFactor = 0.5, kGreatestGuessFactor = 1.5;
constexpr double kFactorStep =
    1.05;  // half a step misjudges a turn of a third of the picture by 1 px in 1600
// How far a rotation may miss the inliers (median), over the longer side: as far as uncorrected distortion
// moves them. Over a plane, a step of a third of the picture misses by five times as much at the known focal
// length and by twice as much at the least favourable one.
constexpr double kMaxRotationMissShare = 0.002;
constexpr double kMaxRotationMissPx = 2;  // half of what COLMAP accepts in a pair; for small pictures
// Enough for a median, and keeps thousands of pairs within a second.
constexpr std::size_t kMaxRays = 150;
// Reweighting by the residuals: matches beside the plane must not turn the rotation.
constexpr int kRounds = 4;

struct View {
  int width = 0, height = 0;
  double focal_px = 0;
  bool is_known = false;
  const Features* features = nullptr;

  // Focal length under the common factor.
  double Focal(double factor) const {
    return focal_px * (is_known ? std::clamp(factor, 1 / kKnownFocalFactor, kKnownFocalFactor) : factor);
  }
  Eigen::Vector3d Ray(int keypoint, double focal) const {
    const Keypoint& k = features->keypoints[static_cast<std::size_t>(keypoint)];
    return Eigen::Vector3d(k.x - 0.5 * width, k.y - 0.5 * height, focal).normalized();
  }
};

std::map<std::string, View> ViewsByName(const CapturedViews& views) {
  std::map<std::string, View> by_name;
  for (const CameraGroup& group : views.groups) {
    for (const std::string& name : group.names) {
      by_name[name] = {group.width, group.height, FocalOrGuess(group), group.focal_px > 0};
    }
  }
  for (std::size_t i = 0; i < views.names.size(); ++i) by_name[views.names[i]].features = &views.features[i];
  return by_name;
}

// Median distance, in pixels of b, by which the best rotation misses the pair's inliers.
double RotationMissPx(const View& a, const View& b, const VerifiedPair& pair, double factor) {
  const double focal_a = a.Focal(factor), focal_b = b.Focal(factor);
  std::vector<Eigen::Vector3d> rays_a, rays_b;
  const std::size_t step = (pair.matches.size() + kMaxRays - 1) / kMaxRays;
  for (std::size_t i = 0; i < pair.matches.size(); i += step) {
    rays_a.push_back(a.Ray(pair.matches[i][0], focal_a));
    rays_b.push_back(b.Ray(pair.matches[i][1], focal_b));
  }
  std::vector<double> misses(rays_a.size(), 0);
  double median = 0;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < rays_a.size(); ++i) {
      const double share = median > 0 ? misses[i] / median : 0;
      sum += rays_b[i] * rays_a[i].transpose() / (1 + share * share);
    }
    const Eigen::Matrix3d b_from_a = io::NearestRotation(sum);
    for (std::size_t i = 0; i < rays_a.size(); ++i) {
      misses[i] = focal_b * (b_from_a * rays_a[i]).cross(rays_b[i]).norm();
    }
    median = io::Median(misses);
  }
  return median;
}

// Factors from 1 outwards, so that the first of several equal ones is the most likely one.
std::vector<double> FocalFactors(bool all_known) {
  const double least = all_known ? 1 / kKnownFocalFactor : kLeastGuessFactor;
  const double greatest = all_known ? kKnownFocalFactor : kGreatestGuessFactor;
  std::vector<double> factors = {1};
  for (double up = kFactorStep, down = 1 / kFactorStep; up <= greatest || down >= least;
       up *= kFactorStep, down /= kFactorStep) {
    if (up <= greatest) factors.push_back(up);
    if (down >= least) factors.push_back(down);
  }
  return factors;
}

}  // namespace

void DistinguishFlatPairs(const CapturedViews& views, std::vector<VerifiedPair>* pairs) {
  const std::map<std::string, View> by_name = ViewsByName(views);
  std::vector<VerifiedPair*> flat;
  for (VerifiedPair& pair : *pairs) {
    if (pair.geometry == PairGeometry::kHomography && !pair.matches.empty()) flat.push_back(&pair);
  }
  const bool all_known = std::all_of(
      views.groups.begin(), views.groups.end(), [](const CameraGroup& group) { return group.focal_px > 0; });
  long most = -1;
  std::vector<bool> rotates;
  for (const double factor : FocalFactors(all_known)) {
    std::vector<bool> candidate;
    for (const VerifiedPair* pair : flat) {
      const View &a = by_name.at(pair->name_a), &b = by_name.at(pair->name_b);
      const double limit = std::max(kMaxRotationMissPx, kMaxRotationMissShare * std::max(b.width, b.height));
      candidate.push_back(RotationMissPx(a, b, *pair, factor) <= limit);
    }
    const long count = std::count(candidate.begin(), candidate.end(), true);
    if (count <= most) continue;
    most = count;
    rotates = std::move(candidate);
  }
  for (std::size_t i = 0; i < flat.size(); ++i) {
    flat[i]->geometry = rotates[i] ? PairGeometry::kRotation : PairGeometry::kPlane;
  }
}

}  // namespace sfm
