#include "sfm/synthetic/synthetic_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "sfm/synthetic/synthetic_world.h"

namespace sfm {
namespace {

// Streams of the capture's seed.
constexpr std::uint64_t kCameraStream = 1, kPointStream = 2, kObservationStream = 3, kMatchStream = 4;
constexpr double kSparseShare = 0.3;  // MatchGraph::kSparse
// A keypoint of a sharp picture; sfm/mapping/diagnosis.h calls features of 4 px and more blurred.
constexpr float kKeypointScale = 2;
// The second body turns and drifts this much from picture to picture.
constexpr double kBodyTurn = 6 * std::numbers::pi / 180, kBodyDrift = 0.05;
// Rows until a rolling shutter's projection is a fixed point: each step shrinks the error by the share of
// the picture that passes during readout, below 1/20 for all but whip pans.
constexpr int kShutterSteps = 12;
// Rays that differ by more come from the far side of a distortion that folds back.
constexpr double kSameRay = 1e-6;
// A surface seen at a flatter angle than 15 degrees gives no match.
constexpr double kMinFacing = 0.26;
// A matcher's ratio test: the second most similar look must differ clearly more than the first.
constexpr double kLookRatio = 0.8;

struct Observation {
  int point;  // into the world's points; -1: overlay
  Eigen::Vector2d xy;
};

// What one picture sees; `main`, `body` and `overlay` follow each other in the keypoints.
struct View {
  io::Camera camera;
  io::Rigid3d world_from_cam;
  std::vector<Observation> observations;
  std::size_t n_main = 0, n_body = 0;
};

using Matches = std::vector<std::array<int, 2>>;

// Whether several points have one pattern.
bool Repeats(Structure structure) {
  return structure == Structure::kIdenticalSides || structure == Structure::kTwoFacades ||
         structure == Structure::kTiledFloor;
}

// How many wrong matches join `right` ones to make up `share` of the sum.
int OutliersBeside(int right, double share) {
  return static_cast<int>(std::lround(right * share / (1 - share)));
}

std::optional<Eigen::Vector2d> Project(const io::Camera& camera, const Eigen::Vector3d& x_in_cam) {
  const auto xy = io::ImgFromCam(camera, x_in_cam);
  if (!xy || xy->x() < 0 || xy->y() < 0 || xy->x() > camera.width || xy->y() > camera.height)
    return std::nullopt;
  if (camera.HasDistortion()) {
    const auto ray = io::RayFromImg(camera, *xy);
    if (!ray || (*ray - x_in_cam.normalized()).norm() > kSameRay) return std::nullopt;
  }
  return xy;
}

// The camera's pose holds for the middle row; `shutter` is the rotation vector from the first row to the
// last.
std::optional<Eigen::Vector2d> ProjectRolling(const io::Camera& camera,
                                              const Eigen::Vector3d& x_in_cam,
                                              const Eigen::Vector3d& shutter) {
  auto xy = Project(camera, x_in_cam);
  if (shutter.isZero()) return xy;
  for (int step = 0; step < kShutterSteps && xy; ++step) {
    const double since_middle = xy->y() / camera.height - 0.5;
    const Eigen::AngleAxisd turn(since_middle * shutter.norm(), shutter.normalized());
    xy = Project(camera, turn.inverse() * x_in_cam);
  }
  return xy;
}

Eigen::Vector3d UnitVector(Random* random) {
  Eigen::Vector3d x{random->Normal(), random->Normal(), random->Normal()};
  return x.normalized();
}

// Pose of the second body in picture i; it starts among the points of the subject.
Eigen::Vector3d MoveBody(int i, const Eigen::Vector3d& x) {
  return Eigen::AngleAxisd(kBodyTurn * i, Eigen::Vector3d(0.6, 0, 0.8)) * x +
         kBodyDrift * i * Eigen::Vector3d(1, 0.5, 0);
}

// Pixels, relative to the picture's size, of the frame that an overlay fills.
std::vector<Eigen::Vector2d> MakeOverlay(int count, double border, Random* random) {
  std::vector<Eigen::Vector2d> overlay;
  while (static_cast<int>(overlay.size()) < count) {
    const double x = random->Uniform(), y = random->Uniform();
    if (std::min(std::min(x, 1 - x), std::min(y, 1 - y)) <= border) overlay.push_back({x, y});
  }
  return overlay;
}

class Generator {
 public:
  explicit Generator(const CaptureOptions& options)
      : options_(options),
        camera_random_(options.seed, kCameraStream),
        point_random_(options.seed, kPointStream),
        observation_random_(options.seed, kObservationStream),
        match_random_(options.seed, kMatchStream) {}

  SyntheticCapture Make() {
    MakeWorld();
    for (const io::Rigid3d& pose : MakeTrajectory(options_, &camera_random_)) AddView(pose);
    const int n = static_cast<int>(views_.size());
    for (int a = 0; a < n; ++a) {
      for (int b = a + 1; b < n; ++b) {
        PairMatches pair{a, b, {}};
        if (IsMatched(a, b)) pair.matches = Match(views_[Index(a)], views_[Index(b)]);
        if (!pair.matches.empty()) capture_.matches.push_back(std::move(pair));
      }
    }
    return std::move(capture_);
  }

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }
  Eigen::Vector3d ToWorld(const Eigen::Vector3d& x) const { return options_.scale * x + options_.offset; }

  void MakeWorld() {
    points_ = MakeStructure(options_, &point_random_);
    const int wrong = OutliersBeside(static_cast<int>(points_.size()), options_.outlier_share);
    if (options_.outliers == Outliers::kSecondMotion) {
      CaptureOptions body = options_;
      body.points = wrong;
      body_ = MakeStructure(body, &point_random_);
    } else if (options_.outliers == Outliers::kStaticOverlay) {
      overlay_ = MakeOverlay(wrong, options_.overlay_border, &point_random_);
    }
    capture_.truth.cameras = options_.cameras;
    capture_.truth.points.resize(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) capture_.truth.points[i].xyz = ToWorld(points_[i].xyz);
  }

  void AddView(const io::Rigid3d& pose) {
    const int index = static_cast<int>(views_.size());
    const int camera_index = index % static_cast<int>(options_.cameras.size());
    View view{.camera = options_.cameras[Index(camera_index)],
              .world_from_cam = {pose.rotation, ToWorld(pose.translation)}};
    const Eigen::Vector3d shutter =
        options_.rolling_shutter_deg * std::numbers::pi / 180 * UnitVector(&camera_random_);
    const auto see = [&](int point, const Eigen::Vector3d& xyz) {
      // The difference comes first: far from the origin R^T X - R^T C would be rounding.
      const Eigen::Vector3d x_in_cam =
          pose.rotation.transpose() * (ToWorld(xyz) - view.world_from_cam.translation);
      const auto xy = ProjectRolling(view.camera, x_in_cam, shutter);
      if (xy) view.observations.push_back({point, *xy});
      return xy.has_value();
    };
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d to_camera = (pose.translation - points_[i].xyz).normalized();
      if (!points_[i].normal.isZero() && points_[i].normal.dot(to_camera) < kMinFacing) continue;
      if (see(static_cast<int>(i), points_[i].xyz)) capture_.truth.points[i].frame_indices.push_back(index);
    }
    view.n_main = view.observations.size();
    for (std::size_t i = 0; i < body_.size(); ++i)
      see(static_cast<int>(points_.size() + i), MoveBody(index, body_[i].xyz));
    view.n_body = view.observations.size() - view.n_main;
    for (const Eigen::Vector2d& xy : overlay_)
      view.observations.push_back({-1, {xy.x() * view.camera.width, xy.y() * view.camera.height}});
    AddPicture(view, camera_index);
    views_.push_back(std::move(view));
  }

  void AddPicture(const View& view, int camera_index) {
    const std::string name = fmt::format("p{:04}.png", views_.size());
    capture_.pictures.push_back({.name = name,
                                 .width = view.camera.width,
                                 .height = view.camera.height,
                                 .focal_px = options_.focal_guess * view.camera.fl_x,
                                 .camera_group = std::to_string(camera_index)});
    capture_.truth.frames.push_back(
        {.image_path = name, .camera_index = camera_index, .world_from_cam = view.world_from_cam});
    Features features;
    for (const Observation& seen : view.observations) {
      const double x = seen.xy.x() + options_.noise_px * observation_random_.Normal();
      const double y = seen.xy.y() + options_.noise_px * observation_random_.Normal();
      features.keypoints.push_back(
          {.x = static_cast<float>(x), .y = static_cast<float>(y), .scale = kKeypointScale});
    }
    capture_.features.push_back(std::move(features));
  }

  bool IsMatched(int a, int b) {
    switch (options_.graph) {
      case MatchGraph::kFull:
        return true;
      case MatchGraph::kChain:
        return b - a <= options_.chain_overlap;
      case MatchGraph::kSparse:
        return match_random_.Uniform() < kSparseShare || b == a + 1;
    }
    return false;
  }

  Matches Match(const View& a, const View& b) {
    Matches matches = Repeats(options_.structure) ? MatchBySimilarLook(a, b)
                                                  : MatchSamePoint(a, b, 0, a.n_main, 0, b.n_main);
    if (options_.outlier_share <= 0) return matches;
    if (options_.outliers == Outliers::kUniform) {
      Misplace(&matches);
      return matches;
    }
    Matches wrong;
    if (options_.outliers == Outliers::kSecondMotion) {
      wrong = MatchSamePoint(a, b, a.n_main, a.n_main + a.n_body, b.n_main, b.n_main + b.n_body);
    } else {
      for (std::size_t i = 0; i < overlay_.size(); ++i)
        wrong.push_back({static_cast<int>(a.n_main + i), static_cast<int>(b.n_main + i)});
    }
    match_random_.Shuffle(&wrong);
    const int wanted = OutliersBeside(static_cast<int>(matches.size()), options_.outlier_share);
    wrong.resize(std::min(wrong.size(), Index(wanted)));
    matches.insert(matches.end(), wrong.begin(), wrong.end());
    return matches;
  }

  // Observations [a_begin, a_end) and [b_begin, b_end) are sorted by point.
  static Matches MatchSamePoint(const View& a,
                                const View& b,
                                std::size_t a_begin,
                                std::size_t a_end,
                                std::size_t b_begin,
                                std::size_t b_end) {
    Matches matches;
    for (std::size_t i = a_begin, j = b_begin; i < a_end && j < b_end;) {
      const int in_a = a.observations[i].point, in_b = b.observations[j].point;
      if (in_a == in_b) matches.push_back({static_cast<int>(i), static_cast<int>(j)});
      i += in_a <= in_b;
      j += in_b <= in_a;
    }
    return matches;
  }

  // A descriptor cannot tell points of one pattern apart; it knows only from where it looks at them. Mutual
  // nearest neighbours under the angle between the two directions of view, each relative to its pattern.
  Matches MatchBySimilarLook(const View& a, const View& b) const {
    const auto looks = [&](const View& view) {
      std::map<int, std::vector<std::pair<int, Eigen::Vector3d>>> by_pattern;
      for (std::size_t i = 0; i < view.n_main; ++i) {
        const WorldPoint& point = points_[Index(view.observations[i].point)];
        const Eigen::Vector3d ray = (view.world_from_cam.translation - ToWorld(point.xyz)).normalized();
        by_pattern[point.pattern].push_back(
            {static_cast<int>(i), point.world_from_pattern.transpose() * ray});
      }
      return by_pattern;
    };
    // Index in `others` of the most similar look, or -1 when the next one is about as similar.
    const auto nearest = [](const Eigen::Vector3d& look, const auto& others) {
      double first = 3, second = 3;  // distances of unit vectors are at most 2
      int best = -1;
      for (std::size_t i = 0; i < others.size(); ++i) {
        const double distance = (look - others[i].second).norm();
        if (distance < first) best = static_cast<int>(i);
        second = std::min(second, std::max(first, distance));
        first = std::min(first, distance);
      }
      return first < kLookRatio * second ? best : -1;
    };
    Matches matches;
    const auto looks_a = looks(a), looks_b = looks(b);
    for (const auto& [pattern, in_a] : looks_a) {
      const auto in_b = looks_b.find(pattern);
      if (in_b == looks_b.end()) continue;
      for (std::size_t i = 0; i < in_a.size(); ++i) {
        const int j = nearest(in_a[i].second, in_b->second);
        if (j < 0 || nearest(in_b->second[Index(j)].second, in_a) != static_cast<int>(i)) continue;
        matches.push_back({in_a[i].first, in_b->second[Index(j)].first});
      }
    }
    return matches;
  }

  // Passes the partners of some matches round in a ring: each of them is wrong afterwards.
  void Misplace(Matches* matches) {
    const auto count = std::lround(options_.outlier_share * static_cast<double>(matches->size()));
    if (count < 2) return;  // one match alone has no wrong partner to take
    match_random_.Shuffle(matches);
    const int first = matches->front()[1];
    for (std::size_t i = 0; i + 1 < static_cast<std::size_t>(count); ++i)
      (*matches)[i][1] = (*matches)[i + 1][1];
    (*matches)[static_cast<std::size_t>(count) - 1][1] = first;
  }

  const CaptureOptions& options_;
  Random camera_random_, point_random_, observation_random_, match_random_;
  std::vector<WorldPoint> points_, body_;
  std::vector<Eigen::Vector2d> overlay_;
  std::vector<View> views_;
  SyntheticCapture capture_;
};

}  // namespace

SyntheticCapture MakeSyntheticCapture(const CaptureOptions& options) { return Generator(options).Make(); }

}  // namespace sfm
