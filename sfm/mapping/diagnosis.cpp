#include "sfm/mapping/diagnosis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "io/base/median.h"
#include "io/scene/decomposition.h"

namespace sfm {
namespace {

// COLMAP's mapper registers a picture by at least 30 points and needs 15 inliers for a pair; a picture with
// fewer features than this rarely gives both.
constexpr int kFewFeatures = 100;
constexpr int kFewInliers = 30;
// Where more of the pictures than this are linked by matches, lack of overlap does not explain the failure.
constexpr double kMaxUnexplainedShare = 0.8;
// SIFT on a sharp picture finds most features below 3 px; blur removes exactly those.
constexpr double kBlurredScalePx = 4.0;
// COLMAP triangulates from 1.5 degrees. Where half of all points stay this close to that limit, depth is
// noise.
constexpr double kMinMedianAngleDeg = 2.0;
// Measured: 1.00 for a camera that turns.
constexpr double kMaxRotationShare = 0.95;
// Where homographies explain pairs 5 degrees wide to 4 px, points are within a few percent of the distance of
// a plane, and spread a third of it or more along it: 0.1 and less. Those of a folded model fill a volume.
constexpr double kMaxPlaneRatio = 0.25;
// Well above the noise of angles in a folded model, and reached by every capture that surrounds its subject.
constexpr double kWideAngleDeg = 5.0;
// Enough for a median.
constexpr std::size_t kAnglesPerPair = 1000;
// Half a pixel of noise spreads a line of points by less than 1/100 of its length in a picture that it
// crosses.
constexpr double kMinLineRatio = 0.02;
// COLMAP drops observations beyond 4 px; a good model stays below 1.
constexpr double kMaxMeanErrorPx = 3.0;

int MostInliers(const std::string& name, const std::vector<VerifiedPair>& pairs) {
  int most = 0;
  for (const VerifiedPair& pair : pairs) {
    if (pair.name_a == name || pair.name_b == name) most = std::max(most, pair.inliers);
  }
  return most;
}

// How many pictures are linked, directly or through others, to the one that is linked to most.
int LargestLinkedGroup(const CaptureEvidence& evidence) {
  std::map<std::string, std::string> parent;  // towards the group's representative, its own parent
  for (const PictureFeatures& picture : evidence.features) parent[picture.name] = picture.name;
  const auto root = [&](std::string name) {
    while (parent[name] != name) name = parent[name] = parent[parent[name]];
    return name;
  };
  for (const VerifiedPair& pair : evidence.pairs) {
    if (pair.inliers >= kFewInliers) parent[root(pair.name_a)] = root(pair.name_b);
  }
  std::map<std::string, int> sizes;
  int largest = 0;
  for (const PictureFeatures& picture : evidence.features) {
    largest = std::max(largest, ++sizes[root(picture.name)]);
  }
  return largest;
}

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

// Directions from the point to the cameras that observe it, in the order of frame_indices.
std::vector<Eigen::Vector3d> Rays(const io::Scene& scene, const io::Point3D& point) {
  std::vector<Eigen::Vector3d> rays;
  for (const int frame : point.frame_indices) {
    rays.push_back(
        (scene.frames[static_cast<std::size_t>(frame)].world_from_cam.translation - point.xyz).normalized());
  }
  return rays;
}

// The angles at which each of the pairs sees its common points; of the first kAnglesPerPair of them.
std::vector<std::vector<double>> Angles(const io::Scene& scene, const std::vector<VerifiedPair>& pairs) {
  const std::size_t n = scene.frames.size();
  std::map<std::string, std::size_t> frame_index;
  for (std::size_t i = 0; i < n; ++i) frame_index[scene.frames[i].image_path.string()] = i;
  std::vector<int> pair_of(n * n, -1);  // of two frames
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto a = frame_index.find(pairs[i].name_a), b = frame_index.find(pairs[i].name_b);
    if (a == frame_index.end() || b == frame_index.end()) continue;
    pair_of[a->second * n + b->second] = pair_of[b->second * n + a->second] = static_cast<int>(i);
  }
  std::vector<std::vector<double>> angles(pairs.size());
  for (const io::Point3D& point : scene.points) {
    const std::vector<Eigen::Vector3d> rays = Rays(scene, point);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const auto row = static_cast<std::size_t>(point.frame_indices[i]) * n;
      for (std::size_t j = i + 1; j < rays.size(); ++j) {
        const int pair = pair_of[row + static_cast<std::size_t>(point.frame_indices[j])];
        if (pair < 0) continue;
        std::vector<double>& seen = angles[static_cast<std::size_t>(pair)];
        if (seen.size() < kAnglesPerPair) seen.push_back(AngleDeg(rays[i], rays[j]));
      }
    }
  }
  return angles;
}

// Pairs that see their common points at more than kWideAngleDeg (median) in this model.
std::vector<VerifiedPair> WidePairs(const io::Scene& scene, const std::vector<VerifiedPair>& pairs) {
  const std::vector<std::vector<double>> angles = Angles(scene, pairs);
  std::vector<VerifiedPair> wide;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!angles[i].empty() && io::Median(angles[i]) > kWideAngleDeg) wide.push_back(pairs[i]);
  }
  return wide;
}

// Of the well supported pairs; 0 without any.
template <typename IsCounted>
double SupportedShare(const std::vector<VerifiedPair>& pairs, const IsCounted& is_counted) {
  int supported = 0, counted = 0;
  for (const VerifiedPair& pair : pairs) {
    if (pair.inliers < kFewInliers) continue;
    ++supported;
    counted += is_counted(pair.geometry);
  }
  return supported == 0 ? 0.0 : static_cast<double>(counted) / supported;
}

// Root mean squares, ascending, of the half of the points nearest to their median, along the axes of its
// scatter.
Eigen::Vector3d Spreads(const io::Scene& scene) {
  Eigen::Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const io::Point3D& point : scene.points) values.push_back(point.xyz[axis]);
    median[axis] = io::Median(std::move(values));
  }
  std::vector<Eigen::Vector3d> offsets;
  for (const io::Point3D& point : scene.points) offsets.push_back(point.xyz - median);
  std::sort(offsets.begin(), offsets.end(), [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return a.squaredNorm() < b.squaredNorm();
  });
  offsets.resize((offsets.size() + 1) / 2);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& offset : offsets) scatter += offset * offset.transpose();
  const Eigen::Vector3d squares = io::EigenDecomposition(scatter).values;
  return (squares / static_cast<double>(offsets.size())).cwiseMax(0).cwiseSqrt();
}

Refusal RotationOnly(double share) {
  return {RefusalCause::kRotationOnly,
          fmt::format("in {:.0f} % of the picture pairs a pure rotation explains everything, so depth cannot "
                      "be measured",
                      100 * share)};
}

}  // namespace

std::vector<PictureFeatures> Summaries(const std::vector<std::string>& names,
                                       const std::vector<Features>& features) {
  std::vector<PictureFeatures> summaries;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::vector<double> scales;
    for (const Keypoint& keypoint : features[i].keypoints) scales.push_back(keypoint.scale);
    summaries.push_back({names[i], static_cast<int>(scales.size()), io::Median(scales)});
  }
  return summaries;
}

double MedianTriangulationAngleDeg(const io::Scene& scene) {
  std::vector<double> angles;
  for (const io::Point3D& point : scene.points) {
    const std::vector<Eigen::Vector3d> rays = Rays(scene, point);
    std::size_t a = 0, b = 0;  // the rays that are farthest apart
    for (std::size_t i = 0; i < rays.size(); ++i) {
      for (std::size_t j = i + 1; j < rays.size(); ++j) {
        if (a == b || rays[i].dot(rays[j]) < rays[a].dot(rays[b])) a = i, b = j;
      }
    }
    angles.push_back(rays.empty() ? 0 : AngleDeg(rays[a], rays[b]));
  }
  return io::Median(angles);
}

double RotationShare(const std::vector<VerifiedPair>& pairs) {
  return SupportedShare(pairs, [](PairGeometry geometry) { return geometry == PairGeometry::kRotation; });
}

double FoldedShare(const io::Scene& scene, const std::vector<VerifiedPair>& pairs) {
  return RotationShare(WidePairs(scene, pairs));
}

double FlatShare(const io::Scene& scene, const std::vector<VerifiedPair>& pairs) {
  return SupportedShare(WidePairs(scene, pairs),
                        [](PairGeometry geometry) { return geometry != PairGeometry::kGeneral; });
}

bool IsFlat(const io::Scene& scene, const std::vector<VerifiedPair>& pairs) {
  return FlatShare(scene, pairs) > kMaxRotationShare;
}

double PlaneRatio(const io::Scene& scene) {
  if (scene.points.empty()) return 1;
  const Eigen::Vector3d spreads = Spreads(scene);
  return spreads[1] > 0 ? spreads[0] / spreads[1] : 0;
}

double LineRatio(const io::Scene& scene) {
  if (scene.points.empty()) return 1;
  const Eigen::Vector3d spreads = Spreads(scene);
  return spreads[2] > 0 ? spreads[1] / spreads[2] : 0;
}

std::optional<Refusal> JudgeModel(const io::ColmapModel& model, const CaptureEvidence& evidence) {
  const int registered = static_cast<int>(model.scene.frames.size());
  if (registered < kMinPictures || model.scene.points.empty()) return ExplainFailure(evidence, registered);
  const double share = FoldedShare(model.scene, evidence.pairs);
  if (share > kMaxRotationShare) return RotationOnly(share);
  // A rotation that passed for a plane, be it for distortion, comes out as anything but a plane.
  if (IsFlat(model.scene, evidence.pairs) && PlaneRatio(model.scene) > kMaxPlaneRatio) {
    return Refusal{
        RefusalCause::kRotationOnly,
        fmt::format("a homography explains {:.0f} % of the picture pairs, but the points do not lie "
                    "near a plane (spread off it {:.2f} of that along it): the camera only turned",
                    100 * FlatShare(model.scene, evidence.pairs),
                    PlaneRatio(model.scene))};
  }
  const double angle = MedianTriangulationAngleDeg(model.scene);
  if (angle < kMinMedianAngleDeg) {
    return Refusal{
        RefusalCause::kNarrowRays,
        fmt::format("rays to the same point differ by only {:.2f} degrees (median; {:.1f} are needed)",
                    angle,
                    kMinMedianAngleDeg)};
  }
  const double line = LineRatio(model.scene);
  if (line < kMinLineRatio) {
    return Refusal{RefusalCause::kPointsOnOneLine,
                   fmt::format("all points lie on one line (spread across it {:.3f} of that along it), about "
                               "which the cameras could turn freely",
                               line)};
  }
  const double error = model.mean_reprojection_error_px;
  if (!(error < kMaxMeanErrorPx)) {
    return Refusal{
        RefusalCause::kLargeError,
        fmt::format("points miss their pictures by {:.1f} px on average (at most {:.0f} are accepted)",
                    error,
                    kMaxMeanErrorPx)};
  }
  return std::nullopt;
}

Refusal ExplainFailure(const CaptureEvidence& evidence, int registered) {
  const int n = static_cast<int>(evidence.features.size());
  if (n < kMinPictures) return {RefusalCause::kTooFewPictures, std::to_string(n)};
  std::vector<int> counts;
  std::vector<double> scales;
  int poor = 0;
  for (const PictureFeatures& picture : evidence.features) {
    counts.push_back(picture.count);
    if (picture.count > 0) scales.push_back(picture.median_scale_px);
    poor += picture.count < kFewFeatures;
  }
  const double scale = io::Median(scales);
  if (scale > kBlurredScalePx && 2 * poor > n) {
    return {
        RefusalCause::kBlur,
        fmt::format("{} of {} pictures have no fine detail (median feature size {:.1f} px)", poor, n, scale)};
  }
  if (2 * poor > n) {
    return {RefusalCause::kNoTexture,
            fmt::format("{} of {} pictures show fewer than {} features (median {})",
                        poor,
                        n,
                        kFewFeatures,
                        io::Median(counts))};
  }
  const double share = RotationShare(evidence.pairs);
  if (share > kMaxRotationShare) return RotationOnly(share);
  const int linked = LargestLinkedGroup(evidence);
  if (linked > kMaxUnexplainedShare * n) {
    return {RefusalCause::kMisfit,
            fmt::format(
                "{} of {} pictures are linked by matches, but only {} fit together", linked, n, registered)};
  }
  return {RefusalCause::kNoOverlap,
          fmt::format("only {} of {} pictures form one model (the largest group linked by matches has {})",
                      registered,
                      n,
                      linked)};
}

Refusal ExplainMissingPicture(const std::string& name, const CaptureEvidence& evidence) {
  for (const PictureFeatures& picture : evidence.features) {
    if (picture.name != name || picture.count >= kFewFeatures) continue;
    if (picture.count > 0 && picture.median_scale_px > kBlurredScalePx) {
      return {RefusalCause::kBlur,
              fmt::format("{} features, median size {:.1f} px", picture.count, picture.median_scale_px)};
    }
    return {RefusalCause::kNoTexture, fmt::format("{} features", picture.count)};
  }
  const int inliers = MostInliers(name, evidence.pairs);
  if (inliers < kFewInliers) {
    return {RefusalCause::kNoOverlap, fmt::format("its best pair shares {} matches", inliers)};
  }
  return {RefusalCause::kMisfit,
          fmt::format("{} matches with another picture, but too few agree with the model", inliers)};
}

}  // namespace sfm
