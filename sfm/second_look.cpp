#include "sfm/second_look.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "io/base/median.h"
#include "sfm/mapping/pair_agreement.h"

namespace sfm {
namespace {

// Of the inliers of a picture's pairs. A right pose agrees with nearly all of them, a wrong one with those of
// a few pairs, by which it was found.
constexpr double kMaxContradictingShare = 0.5;

// A pose is too uncertain when it hangs on fewer points than COLMAP's defaults ask for (relaxed attempts take
// half as many), and one standard deviation of its rotation moves the picture by more than this share of its
// longer side, three pixels in a thousand, and is so much larger than those of the other pictures. Behind a
// long lens right poses are as uncertain, but on more points.
constexpr int kFewPoints = 30;
constexpr double kMaxPoseSigmaShare = 0.003, kMaxPoseSigmaRatio = 5;
// Few points are usual where the subject is plain, and large errors where a picture is blurred; both together
// are not. In 13 captures, right poses on less than this share of the median number of points have at
// most 1.4 times the median error; the five that reflections on a helmet put wrong have 1.7 to 2.5 times
// that.
constexpr double kFewPointsShare = 0.25, kMisfitRatio = 1.5;
constexpr double kRadians = 3.14159265358979323846 / 180;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

bool Touches(const VerifiedPair& pair, const std::string& name) {
  return pair.name_a == name || pair.name_b == name;
}

std::vector<int> PointsPerFrame(const io::ColmapModel& model) {
  std::vector<int> n_points(model.scene.frames.size(), 0);
  for (const io::Observation& observation : model.observations) ++n_points[Index(observation.frame_index)];
  return n_points;
}

}  // namespace

std::vector<int> LeftOutPictures(const MappingAttempt& attempt) {
  const std::vector<std::string>& names = attempt.views->names;
  std::set<std::string> registered;
  if (!attempt.models.empty()) {
    for (const io::Frame& frame : attempt.models.front().scene.frames)
      registered.insert(frame.image_path.string());
  }
  std::map<std::string, int> matches;
  for (const VerifiedPair& pair : attempt.evidence.pairs) {
    matches[pair.name_a] += pair.inliers;
    matches[pair.name_b] += pair.inliers;
  }
  std::vector<int> left_out;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (registered.count(names[i]) == 0) left_out.push_back(static_cast<int>(i));
  }
  std::stable_sort(left_out.begin(), left_out.end(), [&](int a, int b) {
    return matches[names[Index(a)]] > matches[names[Index(b)]];
  });
  return left_out;
}

ImagePairs PairsWith(const std::vector<int>& pictures, int n) {
  ImagePairs pairs;
  for (const int picture : pictures) {
    for (int other = 0; other < n; ++other) {
      if (other != picture) pairs.insert(std::minmax(picture, other));
    }
  }
  return pairs;
}

double Comparisons(const std::vector<Features>& features, const ImagePairs& pairs) {
  double sum = 0;
  for (const auto& [a, b] : pairs) {
    sum += static_cast<double>(features[Index(a)].keypoints.size()) *
           static_cast<double>(features[Index(b)].keypoints.size());
  }
  return sum;
}

std::vector<int> WithinCeiling(const std::vector<int>& pictures,
                               const std::vector<Features>& features,
                               int max_features,
                               double ceiling) {
  const double all =
      std::accumulate(features.begin(), features.end(), 0.0, [](double sum, const Features& picture) {
        return sum + static_cast<double>(picture.keypoints.size());
      });
  std::vector<int> chosen;
  double sum = 0;
  for (const int picture : pictures) {
    sum += all * max_features;
    if (sum > ceiling) break;
    chosen.push_back(picture);
  }
  return chosen;
}

std::vector<std::string> DropContradicted(const std::vector<std::string>& names, MappingAttempt* attempt) {
  std::vector<std::string> dropped;
  io::ColmapModel& model = attempt->models.front();
  for (const std::string& name : names) {
    std::vector<VerifiedPair> pairs;
    for (const VerifiedPair& pair : attempt->evidence.pairs) {
      if (Touches(pair, name)) pairs.push_back(pair);
    }
    const PairAgreement agreement =
        CompareWithPairs(model.scene, attempt->views->names, attempt->views->features, pairs);
    if (agreement.contradicting_share > kMaxContradictingShare) dropped.push_back(name);
  }
  if (!dropped.empty()) model = WithoutFrames(model, {dropped.begin(), dropped.end()});
  return dropped;
}

std::vector<UncertainPicture> UncertainPictures(const io::ColmapModel& model,
                                                const BundleUncertainty& uncertainty) {
  std::vector<double> rotations;
  for (const PoseUncertainty& pose : uncertainty.poses) rotations.push_back(pose.rotation_deg);
  if (rotations.empty()) return {};
  const double median = io::Median(rotations);
  const std::vector<int> n_points = PointsPerFrame(model);
  std::vector<UncertainPicture> uncertain;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    const io::Frame& frame = model.scene.frames[i];
    const io::Camera& camera = model.scene.cameras[Index(frame.camera_index)];
    const double share =
        rotations[i] * kRadians * std::max(camera.fl_x, camera.fl_y) / std::max(camera.width, camera.height);
    if (n_points[i] < kFewPoints && share > kMaxPoseSigmaShare && rotations[i] > kMaxPoseSigmaRatio * median)
      uncertain.push_back({frame.image_path.string(), n_points[i], rotations[i], median});
  }
  std::sort(uncertain.begin(), uncertain.end(), [](const UncertainPicture& a, const UncertainPicture& b) {
    return a.rotation_deg > b.rotation_deg;
  });
  return uncertain;
}

std::vector<MisfittingPicture> MisfittingPictures(const io::ColmapModel& model) {
  const std::vector<int> n_points = PointsPerFrame(model);
  std::vector<double> errors(n_points.size(), 0);
  for (const io::Observation& observation : model.observations) {
    const auto projected = io::Project(model.scene, observation);
    const double error = projected ? (*projected - observation.xy).norm() : HUGE_VAL;
    errors[Index(observation.frame_index)] +=
        error / observation.sigma / n_points[Index(observation.frame_index)];
  }
  if (errors.empty()) return {};
  const double median = io::Median(errors);
  const double few = kFewPointsShare * io::Median(std::vector<double>(n_points.begin(), n_points.end()));
  std::vector<MisfittingPicture> misfits;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (n_points[i] < few && errors[i] > kMisfitRatio * median)
      misfits.push_back({model.scene.frames[i].image_path.string(), n_points[i], errors[i], median});
  }
  std::sort(misfits.begin(), misfits.end(), [](const MisfittingPicture& a, const MisfittingPicture& b) {
    return a.error_px > b.error_px;
  });
  return misfits;
}

io::ColmapModel WithoutFrames(const io::ColmapModel& model, const std::set<std::string>& names) {
  io::ColmapModel kept = model;
  kept.scene.cameras.clear();
  kept.scene.frames.clear();
  kept.scene.points.clear();
  kept.observations.clear();
  std::map<int, int> cameras, frames, points;  // old index to new one
  for (std::size_t i = 0; i < model.scene.frames.size(); ++i) {
    io::Frame frame = model.scene.frames[i];
    if (names.count(frame.image_path.string()) > 0) continue;
    const auto [camera, is_new] =
        cameras.emplace(frame.camera_index, static_cast<int>(kept.scene.cameras.size()));
    if (is_new) kept.scene.cameras.push_back(model.scene.cameras[Index(frame.camera_index)]);
    frame.camera_index = camera->second;
    frames[static_cast<int>(i)] = static_cast<int>(kept.scene.frames.size());
    kept.scene.frames.push_back(std::move(frame));
  }
  for (std::size_t i = 0; i < model.scene.points.size(); ++i) {
    io::Point3D point = model.scene.points[i];
    std::vector<int> seen_by;
    for (const int frame : point.frame_indices) {
      if (frames.count(frame) > 0) seen_by.push_back(frames[frame]);
    }
    if (std::set<int>(seen_by.begin(), seen_by.end()).size() < 2) continue;
    point.frame_indices = std::move(seen_by);
    points[static_cast<int>(i)] = static_cast<int>(kept.scene.points.size());
    kept.scene.points.push_back(std::move(point));
  }
  for (io::Observation observation : model.observations) {
    const auto frame = frames.find(observation.frame_index);
    const auto point = points.find(observation.point_index);
    if (frame == frames.end() || point == points.end()) continue;
    observation.frame_index = frame->second;
    observation.point_index = point->second;
    kept.observations.push_back(observation);
  }
  return kept;
}

}  // namespace sfm
